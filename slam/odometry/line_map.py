# pyright: standard
"""Walls of the recent key frames: what a scan is registered to."""

import math
from collections import deque

import numpy as np
from numba import f8, i8

from features.compiled import kernel
from features.feature import LineForm, Lines
from features.se2 import Array, Pose, rotation, transform
from features.sensor import Mounting

WALL_X, WALL_Y, NORMAL_X, NORMAL_Y, LENGTH, CENTER, VAR_OFFSET, VAR_ANGLE = range(8)
WALL_FIELDS = 8
"""A wall inside the compiled kernels: middle of the segment [m], unit normal towards the sensor that saw it, length
[m], variance of its offset [m^2] at the abscissa CENTER [m], where it is independent of the direction, and variance of
its direction [rad^2]. Abscissas count from the middle, counter-clockwise as the sensor sees it."""

Y_ON_X, X_ON_Y = int(LineForm.Y_ON_X), int(LineForm.X_ON_Y)


class LineMap:
    """Walls of the latest key frames, map frame.

    Parameters
    ----------
    key_frames : how many are kept; the oldest one goes first.

    Attributes
    ----------
    walls : of all key frames that are kept, shape (m, WALL_FIELDS).
    """

    def __init__(self, key_frames: int) -> None:
        self._key_frames: deque[Array] = deque(maxlen=key_frames)
        self.walls: Array = np.empty((0, WALL_FIELDS))

    def add(self, walls_robot: Array, pose_map_robot: Pose) -> None:
        """Append the walls that a key frame sees from a pose, robot frame, shape (k, WALL_FIELDS)."""
        walls = walls_robot.copy()
        walls[:, [WALL_X, WALL_Y]] = transform(pose_map_robot, walls_robot[:, [WALL_X, WALL_Y]])
        walls[:, [NORMAL_X, NORMAL_Y]] = walls_robot[:, [NORMAL_X, NORMAL_Y]] @ rotation(pose_map_robot[2]).T
        self._key_frames.append(walls)
        self.walls = np.concatenate(self._key_frames)


def walls_of_lines(lines: Lines, mounting: Mounting) -> Array:
    """Walls, robot frame, shape (L, WALL_FIELDS), of the lines of a scan, sensor frame (eq. M26)."""
    walls = np.empty((len(lines), WALL_FIELDS))
    _walls_kernel(
        lines.forms, lines.params, lines.centers, lines.covs, lines.ends, mounting.axes,
        np.array([mounting.x, mounting.y]), walls,
    )  # fmt: skip
    return walls


@kernel(i8[:], f8[:, :], f8[:], f8[:, :, :], f8[:, :, :], f8[:, ::1], f8[::1], f8[:, ::1])
def _walls_kernel(forms, params, centers, covs, ends, axes, origin, walls):
    for k in range(forms.size):
        along_x = ends[k, 1, 0] - ends[k, 0, 0]
        along_y = ends[k, 1, 1] - ends[k, 0, 1]
        length = math.hypot(along_x, along_y)
        along_x /= length
        along_y /= length
        middle_x = 0.5 * (ends[k, 0, 0] + ends[k, 1, 0])
        middle_y = 0.5 * (ends[k, 0, 1] + ends[k, 1, 1])
        # The offset of the wall at the abscissa s errs by scale (d0 + (pivot + s rate) d1), d0 and d1 the errors of
        # intercept and slope, or of r and alpha.
        if forms[k] == Y_ON_X or forms[k] == X_ON_Y:
            slope, var_0, var_1 = params[k, 0], covs[k, 1, 1], covs[k, 0, 0]
            scale = 1.0 / math.sqrt(1.0 + slope * slope)
            pivot = (middle_x if forms[k] == Y_ON_X else middle_y) - centers[k]
            rate = along_x if forms[k] == Y_ON_X else along_y
        else:
            var_0, var_1, scale = covs[k, 1, 1], covs[k, 0, 0], 1.0
            cos_alpha, sin_alpha = math.cos(params[k, 0]), math.sin(params[k, 0])
            pivot = middle_x * sin_alpha - middle_y * cos_alpha
            rate = along_x * sin_alpha - along_y * cos_alpha
        mixed = covs[k, 0, 1]
        center = -(pivot + mixed / var_1) / rate

        turned_x = axes[0, 0] * along_x + axes[0, 1] * along_y
        turned_y = axes[1, 0] * along_x + axes[1, 1] * along_y
        arm_x = axes[0, 0] * middle_x + axes[0, 1] * middle_y
        arm_y = axes[1, 0] * middle_x + axes[1, 1] * middle_y
        sense = 1.0 if arm_x * turned_y - arm_y * turned_x > 0.0 else -1.0
        walls[k, WALL_X] = origin[0] + arm_x
        walls[k, WALL_Y] = origin[1] + arm_y
        walls[k, NORMAL_X] = -sense * turned_y
        walls[k, NORMAL_Y] = sense * turned_x
        walls[k, LENGTH] = length
        walls[k, CENTER] = sense * center
        walls[k, VAR_OFFSET] = scale * scale * (var_0 - mixed * mixed / var_1)
        walls[k, VAR_ANGLE] = (scale * rate) ** 2 * var_1
