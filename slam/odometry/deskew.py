# pyright: standard
"""Scans of a robot that moves: every beam carried to where the sensor is in the middle of the sweep (eq. M65-M67)."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import f8, i8

from features.compiled import READ_ONLY, kernel
from features.feature import Corners, Lines
from features.scan import LaserScan
from features.se2 import Array, Pose, rotate_each, wrap_angle
from features.sensor import Mounting, SensorModel
from slam.odometry.line_map import CENTER, LENGTH, NORMAL_X, NORMAL_Y, VAR_ANGLE, VAR_OFFSET, WALL_X, WALL_Y


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """Motion of the robot during a scan.

    Parameters
    ----------
    stamp : middle of the sweep [s].
    pose_odom : pose in the log there, odom frame, shape (3,).
    times : of the beams after the middle, shape (n,) [s].
    poses_middle_robot : of the robot at each beam, in its frame at the middle, shape (n, 3).
    velocity_cov : covariance of the error of the velocity by which these were found, shape (3, 3) [m/s, m/s, rad/s].
    """

    stamp: float
    pose_odom: Pose
    times: Array
    poses_middle_robot: Array
    velocity_cov: Array


def deskew(scan: LaserScan, model: SensorModel, sweep: Sweep) -> LaserScan:
    """Undo the motion of the robot during a scan: the scan as if taken at once in the middle of its sweep."""
    middle = carry_beams(scan, model, np.zeros(3), sweep.poses_middle_robot)
    return LaserScan(middle.ranges, middle.angles, sweep.stamp)


def carry_beams(scan: LaserScan, model: SensorModel, pose_world_robot: Pose, poses_world_robot: Array) -> LaserScan:
    """Carry every beam of a scan to one pose.

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


def poses_at(times: Array, stamps: Sequence[float], poses: Sequence[Pose], over: float) -> Array:
    """Poses at any times, shape (n, 3), given those of the records so far [m, m, rad].

    Between two records the pose is interpolated linearly; before the first it is constant; after the last it is
    extrapolated with the mean velocity over some time before it.

    Parameters
    ----------
    times : shape (n,) [s].
    stamps : of the records, not decreasing [s].
    poses : of the records, shape (3,) each.
    over : time over which the velocity is a mean [s]; none is known from records over less than half of it.
    """
    first = max(0, bisect_right(stamps, min(float(times.min()), stamps[-1] - over)) - 1)
    recent = np.array(stamps[first:])
    known = np.array(poses[first:])
    known[:, 2] = np.unwrap(known[:, 2])
    columns: list[Array] = [*known.T]
    at = np.column_stack([np.interp(times, recent, column) for column in columns])
    elapsed = recent[-1] - recent[0]
    if elapsed >= 0.5 * over > 0.0:
        at += np.maximum(times - recent[-1], 0.0)[:, None] * ((known[-1] - known[0]) / elapsed)
    return at


def doubt_corners(corners_robot: Corners, scan: LaserScan, mounting: Mounting, sweep: Sweep) -> Corners:
    """Corners, robot frame, whose covariances contain that of the motion since the middle of the sweep (eq. M66).

    Parameters
    ----------
    corners_robot : of the scan, robot frame.
    scan : without the motion during it, sensor frame.
    mounting : of the sensor.
    sweep : motion during the scan.
    """
    if not len(corners_robot):
        return corners_robot
    x, y = mounting.points_to_sensor(corners_robot.positions).T
    off = np.abs(wrap_angle(scan.angles - np.arctan2(y, x)[:, None]))
    times = sweep.times[off.argmin(axis=1)]
    records = corners_robot.records.copy()
    by_velocity = np.zeros((len(records), 2, 3))
    by_velocity[:, 0, 0] = by_velocity[:, 1, 1] = times
    by_velocity[:, 0, 2] = -times * corners_robot.positions[:, 1]
    by_velocity[:, 1, 2] = times * corners_robot.positions[:, 0]
    records["cov"] += by_velocity @ sweep.velocity_cov @ by_velocity.transpose(0, 2, 1)
    return Corners(records)


def walls_by_velocity(walls_robot: Array, lines: Lines, scan: LaserScan, mounting: Mounting, sweep: Sweep) -> Array:
    """Jacobian of offset and direction of the walls of a scan by the velocity during it, shape (L, 2, 3) (eq. M66).

    Parameters
    ----------
    walls_robot : lines of the scan as walls, robot frame, shape (L, WALL_FIELDS).
    lines : of the scan, sensor frame.
    scan : without the motion during it, sensor frame.
    mounting : of the sensor.
    sweep : motion during the scan.
    """
    by_velocity = np.zeros((len(walls_robot), 2, 3))
    _walls_by_velocity(
        walls_robot, lines.beams, scan.ranges, scan.angles, sweep.times, mounting.axes,
        np.array([mounting.x, mounting.y]), by_velocity,
    )  # fmt: skip
    return by_velocity


@kernel(f8[:, ::1], i8[:, :], READ_ONLY, READ_ONLY, f8[::1], f8[:, ::1], f8[::1], f8[:, :, ::1])
def _walls_by_velocity(walls, beams, ranges, angles, times, axes, origin, by_velocity):
    n = ranges.size
    onward = 1 if angles[n - 1] >= angles[0] else -1
    for k in range(len(walls)):
        normal_x, normal_y = walls[k, NORMAL_X], walls[k, NORMAL_Y]
        reach = 0.5 * walls[k, LENGTH]
        count = sum_s = sum_ss = 0.0
        sums = np.zeros((2, 2))
        i = beams[k, 0]
        while True:
            x = ranges[i] * math.cos(angles[i])
            y = ranges[i] * math.sin(angles[i])
            turned_x = origin[0] + axes[0, 0] * x + axes[0, 1] * y
            turned_y = origin[1] + axes[1, 0] * x + axes[1, 1] * y
            lever = normal_y * turned_x - normal_x * turned_y
            s = normal_y * (turned_x - walls[k, WALL_X]) - normal_x * (turned_y - walls[k, WALL_Y])
            # A beam without return between those of the wall is nowhere on it.
            if abs(s) <= reach:
                s -= walls[k, CENTER]
                count += 1.0
                sum_s += s
                sum_ss += s * s
                for m in range(2):
                    moved = times[i] if m == 0 else times[i] * lever
                    sums[m, 0] += moved
                    sums[m, 1] += moved * s
            if i == beams[k, 1]:
                break
            i = (i + onward) % n
        determinant = count * sum_ss - sum_s * sum_s
        if not determinant > 0.0:
            continue
        for m in range(2):
            offset = (sum_ss * sums[m, 0] - sum_s * sums[m, 1]) / determinant
            turn = (count * sums[m, 1] - sum_s * sums[m, 0]) / determinant
            for j in range(2):
                value = offset if j == 0 else turn
                if m == 0:
                    by_velocity[k, j, 0] = value * normal_x
                    by_velocity[k, j, 1] = value * normal_y
                else:
                    by_velocity[k, j, 2] = value


def doubt_walls(walls_robot: Array, by_velocity: Array, sweep: Sweep) -> Array:
    """Walls whose variances contain that of the motion since the middle of the sweep, shape (L, WALL_FIELDS)."""
    doubted = walls_robot.copy()
    doubted[:, [VAR_OFFSET, VAR_ANGLE]] += np.einsum("lij,jk,lik->li", by_velocity, sweep.velocity_cov, by_velocity)
    return doubted


def doubt_pose(walls_robot: Array, by_velocity: Array, sweep: Sweep, unknown_cov: Array) -> Array:
    """Covariance of a pose found by walls, robot frame, shape (3, 3), that is due to the motion during the sweep.

    Parameters
    ----------
    walls_robot : lines of the scan as walls, robot frame, shape (L, WALL_FIELDS).
    by_velocity : of :func:`walls_by_velocity`, shape (L, 2, 3).
    sweep : motion during the scan.
    unknown_cov : covariance of a pose of which nothing is known, shape (3, 3).
    """
    by_pose = np.zeros((len(walls_robot), 2, 3))
    by_pose[:, 0] = np.column_stack([walls_robot[:, [NORMAL_X, NORMAL_Y]], _levers(walls_robot)])
    by_pose[:, 1, 2] = 1.0
    weighted = by_pose / walls_robot[:, [VAR_OFFSET, VAR_ANGLE], None]
    information = np.einsum("lij,lik->jk", weighted, by_pose) + np.linalg.inv(unknown_cov)
    moved = np.linalg.solve(information, np.einsum("lij,lik->jk", weighted, by_velocity))
    return moved @ sweep.velocity_cov @ moved.T


def _levers(walls_robot: Array) -> Array:
    """Abscissa of the robot's frame along each wall where its offset and direction are independent, shape (L,) [m]."""
    x, y, normal_x, normal_y = walls_robot[:, [WALL_X, WALL_Y, NORMAL_X, NORMAL_Y]].T
    return normal_y * x - normal_x * y + walls_robot[:, CENTER]
