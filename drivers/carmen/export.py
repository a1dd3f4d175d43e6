"""Writes frames as a CARMEN log."""

import gzip
import logging
import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from drivers.errors import RecordError
from drivers.frame import Frame
from features.scan import LaserScan
from features.se2 import compose
from features.sensor import Mounting

logger = logging.getLogger(__name__)

SPACING_TOLERANCE = 1e-9
"""Largest deviation of a beam from the even spacing that a CARMEN log describes [rad]."""


def write_carmen(path: str | os.PathLike[str], frames: Iterable[Frame], mounting: Mounting, range_max: float) -> None:
    """Write frames as ``ROBOTLASER1`` and ``ODOM`` records, the mounting as ``PARAM`` lines.

    Lengths are kept to the micrometre. The beams of a sensor that hangs upside down run the other way round.

    Parameters
    ----------
    path : file to write, gzipped if its name ends with ``.gz``; an existing one is replaced.
    frames : in the order of their stamps.
    mounting : where the sensor sits on the robot.
    range_max : range that is written for no return [m].

    Raises
    ------
    RecordError
        The beams of a scan are not evenly spaced, or the file cannot be written.
    """
    path = Path(path)
    try:
        with (
            gzip.open(path, "wt", encoding="ascii") if path.suffix == ".gz" else path.open("w", encoding="ascii") as log
        ):
            log.writelines(f"{line}\n" for line in _lines(frames, mounting, range_max))
    except OSError as error:
        raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from None


def _lines(frames: Iterable[Frame], mounting: Mounting, range_max: float) -> Iterator[str]:
    yield f"PARAM robot_frontlaser_offset {mounting.x!r}"
    yield f"PARAM robot_frontlaser_side_offset {mounting.y!r}"
    yield f"PARAM robot_frontlaser_angular_offset {mounting.theta!r}"
    timed = False
    for frame in frames:
        robot = " ".join(f"{value:.9f}" for value in frame.pose_odom_robot)
        tail = f"{frame.stamp:.6f} cwlf-slam {frame.stamp:.6f}"
        if frame.scan is None:
            yield f"ODOM {robot} 0 0 0 {tail}"
            continue
        if frame.scan.times is not None and not timed:
            timed = True
            logger.warning("a CARMEN log has no time for each beam: left out")
        laser = " ".join(f"{value:.9f}" for value in compose(frame.pose_odom_robot, mounting.pose_robot_sensor))
        yield f"ROBOTLASER1 {_scan(frame.scan, mounting, range_max)} 0 {laser} {robot} 0 0 0 0 0 {tail}"


def _scan(scan: LaserScan, mounting: Mounting, range_max: float) -> str:
    """Fields of a scan, from the type of the laser to its ranges."""
    angles = -scan.angles if mounting.upside_down else scan.angles
    start, count = float(angles[0]), len(angles)
    spacing = float(angles[-1] - start) / max(count - 1, 1)
    off = abs(angles - (start + spacing * np.arange(count)))
    if off.max() > SPACING_TOLERANCE:
        raise RecordError(
            f"scan at {scan.stamp:.6f} s: beam {int(off.argmax())} is {math.degrees(off.max()):.6f} deg off an even "
            "spacing, the only one that a CARMEN log knows"
        )
    ranges = " ".join(f"{min(value, range_max):.6f}" for value in scan.ranges.tolist())
    return f"0 {start!r} {spacing * count!r} {spacing!r} {range_max!r} 0.01 0 {count} {ranges}"
