"""Errors of estimation, configuration and run folders."""

from features.errors import CwlfError


class ConfigError(CwlfError):
    """A configuration that is misspelt, contradictory or out of its limits."""


class DivergedError(CwlfError):
    """The estimate is not finite, its covariance not positive definite, or the graph has no unique solution."""


class RunFolderError(CwlfError):
    """A run folder that cannot be written or read."""


class StudyError(CwlfError):
    """A study whose tasks cannot be done, or not all of them."""


class ViewError(CwlfError):
    """A view that cannot be shown."""
