# pyright: standard
"""Compiled code on poses of SE(2)."""

import math

import numpy as np
from numba import f8

from features.compiled import kernel


@kernel(f8[::1], f8[:, ::1], f8[:, :, ::1], f8[::1], f8[:, ::1])
def compound(pose, cov, crosses, motion, motion_cov):
    """Append a motion to an uncertain pose (Smith, Self and Cheeseman 1990), eq. M11.

    Parameters
    ----------
    pose, cov : of the robot, shapes (3,) and (3, 3) [m, m, rad].
    crosses : covariances of the pose with what stands still, shape (k, 3, m); those after the motion take their place.
    motion, motion_cov : pose of the robot after the motion in its frame before, shape (3,), and the covariance of its
        coordinates, shape (3, 3); independent of the pose.

    Returns
    -------
    Pose and covariance after the motion, and whether all their entries are finite.
    """
    c = math.cos(pose[2])
    s = math.sin(pose[2])
    arm_x = c * motion[0] - s * motion[1]
    arm_y = s * motion[0] + c * motion[1]
    heading = (pose[2] + motion[2] + math.pi) % (2.0 * math.pi) - math.pi
    moved = np.array([pose[0] + arm_x, pose[1] + arm_y, heading])
    # The Jacobian by the pose is the identity but for the arm, that by the motion a rotation.
    for cross in crosses:
        cross[0] -= arm_y * cross[2]
        cross[1] += arm_x * cross[2]
    after = cov.copy()
    after[0] -= arm_y * after[2]
    after[1] += arm_x * after[2]
    after[:, 0] -= arm_y * after[:, 2]
    after[:, 1] += arm_x * after[:, 2]
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for m in range(3):
                    after[i, j] += turn[i, k] * motion_cov[k, m] * turn[j, m]
    return moved, after, np.isfinite(moved).all() and np.isfinite(after).all()
