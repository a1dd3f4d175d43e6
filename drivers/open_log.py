"""Opens a log of any kind."""

import os
import zlib
from pathlib import Path

from drivers.carmen import CarmenLog
from drivers.frame import FrameSource
from drivers.log_lines import GZIP_MAGIC
from drivers.mrclam import MrclamLog, is_mrclam
from drivers.recording import Recording
from drivers.victoria_park import VictoriaPark, is_edge_list


def open_log(path: str | os.PathLike[str]) -> FrameSource:
    """Open a log: a recording of ours and a list of edges are known by how they begin, any other file is of CARMEN.

    Parameters
    ----------
    path : the log, plain or gzipped, whatever its name; of an MRCLAM data set the folder, or the odometry of a robot.

    Raises
    ------
    LogFormatError
        The file cannot be opened, or what comes before its first frame is unusable.
    """
    if is_mrclam(path):
        return MrclamLog(path)
    start = text_start(path)
    if start.startswith(b"{"):
        return Recording(path)
    return VictoriaPark(path) if is_edge_list(start) else CarmenLog(path)


def is_recording(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as a recording does."""
    return text_start(path).startswith(b"{")


def text_start(path: str | os.PathLike[str]) -> bytes:
    """First bytes of the text of a file, gzipped or not; none where it cannot be read."""
    try:
        with Path(path).open("rb") as file:
            start = file.read(512)
        if start.startswith(GZIP_MAGIC):
            start = zlib.decompressobj(zlib.MAX_WBITS | 16).decompress(start, 64)
    except (OSError, zlib.error):
        return b""  # who reads it says what is wrong with it
    return start
