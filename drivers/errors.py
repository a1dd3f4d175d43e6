"""What goes wrong with a source of data."""

from features.errors import CwlfError


class LogFormatError(CwlfError):
    """A log that cannot be read; the message names the file, the line, the cause and what was expected."""
