"""The root of every error that the project raises on bad data, and those of scans and features."""


class CwlfError(Exception):
    """Root of the project's errors; its message is one sentence for a person: what, where, what to do."""


class ScanFormatError(CwlfError):
    """A scan whose ranges, angles or stamp cannot be used."""


class DegenerateSegmentError(CwlfError):
    """A segment whose points do not define a line."""
