"""Errors of sources and recordings."""

from features.errors import CwlfError


class LogFormatError(CwlfError):
    """A log that cannot be read; the message names the file, the line, the cause and what was expected."""


class RecordError(CwlfError):
    """A recording or an export that cannot be written."""


class DriverError(CwlfError):
    """A device that cannot be used; the message names the port, the cause and what to do."""
