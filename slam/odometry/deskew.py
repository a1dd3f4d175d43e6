"""Scans of a robot that moves: every beam carried to where the sensor is at one instant."""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from features.scan import LaserScan
from features.se2 import Array, Pose, rotate_each, wrap_angle
from features.sensor import SensorModel


def deskew(scan: LaserScan, model: SensorModel, pose_world_robot: Pose, poses_world_robot: Array) -> LaserScan:
    """Undo the motion of the robot during a scan.

    Parameters
    ----------
    scan : as it was taken, sensor frame.
    model : its limits and its mounting; a beam without return keeps its range and turns with the robot.
    pose_world_robot : reference pose of the de-skewed scan, shape (3,), any fixed frame [m, m, rad].
    poses_world_robot : where it was at each beam, shape (n, 3), the same frame [m, m, rad].

    Returns
    -------
    The scan as taken at once from ``pose_world_robot``, without times.
    """
    returned = model.returned(scan.ranges)
    ranges = np.where(returned, scan.ranges, 0.0)
    points_sensor = ranges[:, None] * np.column_stack([np.cos(scan.angles), np.sin(scan.angles)])
    points_robot = model.mounting.points_to_robot(points_sensor)
    points_world = rotate_each(points_robot, poses_world_robot[:, 2]) + poses_world_robot[:, :2]
    moved_robot = rotate_each(points_world - pose_world_robot[:2], -pose_world_robot[2])
    moved = model.mounting.points_to_sensor(moved_robot)
    turns = np.linalg.det(model.mounting.axes) * wrap_angle(poses_world_robot[:, 2] - float(pose_world_robot[2]))
    # The same turn of the sensor as before, so that beams of one sweep stay in order.
    seen_turns = wrap_angle(np.arctan2(moved[:, 1], moved[:, 0]) - scan.angles)
    return LaserScan(
        ranges=np.where(returned, np.hypot(*moved.T), scan.ranges),
        angles=scan.angles + np.where(returned, seen_turns, turns),
        stamp=scan.stamp,
    )


def deskew_by_odometry(
    scan: LaserScan, model: SensorModel, stamps: Sequence[float], poses_odom_robot: Sequence[Pose]
) -> LaserScan:
    """De-skew a scan by odometry: the scan as if taken at the instant of the last record.

    Between two records the pose is interpolated linearly; before the first it is constant; after the last it is
    extrapolated with the velocity between the last two.

    Parameters
    ----------
    scan : as it was taken, sensor frame; one without times is returned as it is.
    model : its limits and its mounting.
    stamps : of the records so far, not decreasing [s].
    poses_odom_robot : of the records, shape (3,) each [m, m, rad].
    """
    if scan.times is None or len(scan) == 0:
        return scan
    times = scan.stamp + scan.times
    first = max(0, min(bisect_right(stamps, times.min()), len(stamps)) - 1)
    # A record before the last, so that there is a velocity to go on with.
    first = min(first, max(0, bisect_right(stamps, np.nextafter(stamps[-1], -np.inf)) - 1))
    recent = np.array(stamps[first:])
    poses = np.array(poses_odom_robot[first:])
    poses[:, 2] = np.unwrap(poses[:, 2])
    columns: list[Array] = [*poses.T]
    beams = np.column_stack([np.interp(times, recent, column) for column in columns])
    before = int(np.searchsorted(recent, stamps[-1])) - 1
    if before >= 0:
        velocity = (poses[-1] - poses[before]) / (recent[-1] - recent[before])
        beams += np.maximum(times - recent[-1], 0.0)[:, None] * velocity
    return deskew(scan, model, poses[-1], beams)
