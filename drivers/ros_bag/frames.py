"""Converts ROS messages into scans, poses and frames."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from drivers.errors import LogFormatError
from drivers.frame import Frame
from features.errors import ScanFormatError
from features.scan import LaserScan
from features.se2 import Array, Pose, between, compose, pose

ODOMETRY_GAP = 5.0
"""Longest gap between two odometry poses over which is interpolated [s]."""


def stamp_of(header: Any, received: float) -> float:
    """Stamp of a message [s]; the time when it was recorded where the stamp is zero, which is unset in ROS."""
    return header.stamp.sec + 1e-9 * header.stamp.nanosec or received


def laser_scan(message: Any, stamp: float) -> LaserScan:
    """Scan of a sensor_msgs/LaserScan; ranges that are NaN or outside the message's limits are no returns.

    Raises
    ------
    ScanFormatError
        The limits, the angles or the times are unusable.
    """
    if not 0.0 <= message.range_min < message.range_max:
        raise ScanFormatError(
            f"range_min {message.range_min:g}, range_max {message.range_max:g}: expected 0 <= range_min < range_max"
        )
    for name in ("angle_increment", "time_increment"):
        if not math.isfinite(getattr(message, name)):
            raise ScanFormatError(f"{name} is {getattr(message, name):g}: expected a finite number")
    with np.errstate(invalid="ignore"):  # a signalling NaN is no return like any other
        ranges = np.asarray(message.ranges, dtype=np.float64)
    beams = np.arange(len(ranges))
    # Scanners report their maximum for no return.
    returned = (ranges >= message.range_min) & (ranges < message.range_max)
    return LaserScan(
        ranges=np.where(returned, ranges, math.inf),
        angles=message.angle_min + beams * message.angle_increment,
        stamp=stamp,
        times=beams * message.time_increment if message.time_increment else None,
    )


def rotation_of(quaternion: Any) -> Array:
    """Rotation matrix, shape (3, 3), of a quaternion of any length.

    Raises
    ------
    LogFormatError
        It is zero or not finite.
    """
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    length2 = x * x + y * y + z * z + w * w
    if not (math.isfinite(length2) and length2 > 1e-12):
        raise LogFormatError(f"quaternion {x:g} {y:g} {z:g} {w:g}: expected one of length 1")
    s = 2.0 / length2
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)],
        ]
    )


def planar_pose(position: Any, orientation: Any) -> Pose:
    """Pose in the plane, shape (3,), of a position and a quaternion: the yaw is the direction of the x axis.

    Raises
    ------
    LogFormatError
        A number is not finite, or the quaternion is zero.
    """
    rotation = rotation_of(orientation)
    if not (math.isfinite(position.x) and math.isfinite(position.y)):
        raise LogFormatError(f"position {position.x:g} {position.y:g}: expected metres")
    return pose(position.x, position.y, math.atan2(rotation[1, 0], rotation[0, 0]))


def with_odometry(frames: Iterable[Frame]) -> Iterator[Frame]:
    """Give each scan the odometry pose at its stamp; scans without odometry before and after them are left out.

    Parameters
    ----------
    frames : in the order of their stamps; frames with a scan have no pose, those without are odometry.
    """
    before: Frame | None = None
    waiting: deque[Frame] = deque()
    for frame in frames:
        while waiting and frame.stamp - waiting[0].stamp > ODOMETRY_GAP:
            waiting.popleft()
        if frame.scan is not None:
            waiting.append(frame)
            continue
        for scan in waiting:
            if before is not None and frame.stamp - before.stamp <= ODOMETRY_GAP:
                yield Frame(scan.stamp, _interpolated(before, frame, scan.stamp), scan.scan)
        waiting.clear()
        before = frame
        yield frame


def _interpolated(before: Frame, after: Frame, stamp: float) -> Pose:
    duration = after.stamp - before.stamp
    share = (stamp - before.stamp) / duration if duration > 0.0 else 1.0
    return compose(before.pose_odom_robot, share * between(before.pose_odom_robot, after.pose_odom_robot))
