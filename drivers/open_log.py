"""Opens a log of any kind."""

import os
import zlib
from pathlib import Path

from drivers.carmen import CarmenLog
from drivers.errors import LogFormatError
from drivers.frame import FrameSource
from drivers.log_lines import GZIP_MAGIC
from drivers.recording import Recording
from drivers.ros_bag_kind import is_ros_bag


def open_log(
    path: str | os.PathLike[str], *, scan_topic: str | None = None, odom_topic: str | None = None
) -> FrameSource:
    """Open a ROS bag, known by its name or its first bytes, a recording of ours, known by these, or else a CARMEN log.

    Parameters
    ----------
    path : the log, whatever its name, a CARMEN log or recording plain or gzipped; or the folder of a ROS 2 bag.
    scan_topic, odom_topic : what to take of a bag, see :class:`drivers.ros_bag.RosBag`.

    Raises
    ------
    LogFormatError
        It cannot be opened, what comes before its first frame is unusable, or topics are asked for of what has none.
    """
    if is_ros_bag(Path(path)):
        from drivers.ros_bag import RosBag

        return RosBag(path, scan_topic, odom_topic)
    if scan_topic is not None or odom_topic is not None:
        raise LogFormatError(f"{path} is no ROS bag, so it has no topics: drop --scan-topic and --odom-topic")
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
