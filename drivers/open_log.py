"""Opens a log of any kind."""

import os
import zlib
from pathlib import Path

from drivers.carmen import CarmenLog
from drivers.frame import FrameSource
from drivers.log_lines import GZIP_MAGIC
from drivers.recording import Recording


def open_log(path: str | os.PathLike[str]) -> FrameSource:
    """Open a recording of ours, known by its first character, or else a CARMEN log.

    Parameters
    ----------
    path : the log, plain or gzipped, whatever its name.

    Raises
    ------
    LogFormatError
        The file cannot be opened, or what comes before its first frame is unusable.
    """
    return Recording(path) if is_recording(path) else CarmenLog(path)


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as a recording does."""
    try:
        with Path(path).open("rb") as file:
            start = file.read(512)
        if start.startswith(GZIP_MAGIC):
            start = zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(start, 64)
    except (OSError, zlib.error):
        return False  # who reads it says what is wrong with it
    return start.startswith(b"{")
