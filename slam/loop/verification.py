"""Verification of a loop closure by registration to the walls of a submap, and the closure with its covariance."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose, between, rotate_each, rotation, wrap_angle
from slam.graph.values import Closure
from slam.odometry.line_map import NORMAL_X, NORMAL_Y, WALL_X, WALL_Y
from slam.odometry.registration import Registration
from slam.odometry.scan_points import ScanPoints


def walls_world(scans: Sequence[ScanPoints], key_frames: NDArray[np.int64], poses_world_robot: Array) -> Array:
    """Walls that key frames saw, world frame, shape (m, WALL_FIELDS).

    Parameters
    ----------
    scans : of all key frames.
    key_frames : those whose walls are wanted, shape (k,), k >= 1.
    poses_world_robot : of all key frames, shape (n, 3).
    """
    keys: list[int] = key_frames.tolist()
    each = [scans[key].walls_robot for key in keys]
    walls = np.concatenate(each)
    homes = poses_world_robot[np.repeat(key_frames, [len(of_one) for of_one in each])]
    walls[:, [WALL_X, WALL_Y]] = rotate_each(walls[:, [WALL_X, WALL_Y]], homes[:, 2]) + homes[:, :2]
    walls[:, [NORMAL_X, NORMAL_Y]] = rotate_each(walls[:, [NORMAL_X, NORMAL_Y]], homes[:, 2])
    return walls


def position_sigma(fit: Registration) -> float:
    """Return the standard deviation of a position in its least certain direction, by the scan alone [m]."""
    information = fit.information
    if not information[2, 2] > 0.0:
        return math.inf
    arm = information[:2, 2:] @ information[2:, :2] / information[2, 2]
    least = float(np.linalg.eigvalsh(information[:2, :2] - arm)[0])
    return 1.0 / math.sqrt(least) if least > 0.0 else math.inf


def closure_of(older: int, newer: int, pose_world_older: Pose, fit: Registration, systematic_cov: Array) -> Closure:
    """Closure that a registration of the newer key frame to the walls about the older one makes (eq. M48).

    ``systematic_cov``, shape (3, 3), is of the errors that all registrations of a place share: walls that are not
    straight, things that were moved.
    """
    motion = between(pose_world_older, fit.pose_map_robot)
    motion[2] = wrap_angle(float(motion[2]))
    turn = np.eye(3)
    turn[:2, :2] = rotation(float(pose_world_older[2])).T
    cov = turn @ np.linalg.inv(fit.information) @ turn.T + systematic_cov
    return Closure(older, newer, motion, cov)
