"""Opens a log of any kind."""

import os
import zlib
from pathlib import Path

from drivers.carmen.log import CarmenLog
from drivers.data_sets.mrclam import MrclamLog, is_mrclam
from drivers.data_sets.victoria_park import VictoriaPark, is_edge_list
from drivers.errors import LogFormatError
from drivers.frame import FrameSource
from drivers.log_lines import GZIP_MAGIC
from drivers.recording.recording import Recording
from drivers.ros_bag.kind import is_ros_bag


def open_log(
    path: str | os.PathLike[str], *, scan_topic: str | None = None, odom_topic: str | None = None
) -> FrameSource:
    """Open a log; its kind is detected by its name and its first bytes, and is CARMEN if no other is detected.

    Parameters
    ----------
    path : the log, plain or gzipped; the folder of a ROS 2 bag; of an MRCLAM data set the folder, or the odometry of a
        robot.
    scan_topic, odom_topic : topics of a ROS bag, see :class:`drivers.ros_bag.bag.RosBag`.

    Raises
    ------
    LogFormatError
        It cannot be opened, what comes before its first frame is unusable, or topics are given for another log.
    """
    if is_mrclam(path) and scan_topic is None and odom_topic is None:
        return MrclamLog(path)
    if is_ros_bag(Path(path)):
        from drivers.ros_bag.bag import RosBag

        return RosBag(path, scan_topic, odom_topic)
    if scan_topic is not None or odom_topic is not None:
        raise LogFormatError(f"{path} is no ROS bag, so it has no topics: drop --scan-topic and --odom-topic")
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
        return b""  # the reader of the log raises the error
    return start
