"""Errors of the simulator."""

from features.errors import CwlfError


class WorldError(CwlfError):
    """A world that cannot be made or read, or through which a robot cannot drive."""
