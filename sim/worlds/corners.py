# pyright: standard
"""The corners of walls: points where exactly two walls end."""

import numpy as np
import numpy.typing as npt
from numba import f8, i8

from features.compiled import kernel
from features.se2 import Array
from sim.casting.wall_index import WallIndex

TOUCH = 1e-9
"""Walls nearer to each other than this meet [m]: far above the rounding of coordinates of a kilometre (1e-13 m), far
below the length of any wall."""

STRAIGHT = 1e-6
"""Two walls that leave a point in directions that differ by less than this lie on each other [rad]: rounding turns
walls of a millimetre or more by less."""

BLUNT = np.radians(10.0)
"""Two walls whose directions differ by less than this are one wall, straight or curved [rad]: curves are drawn with
facets that turn by less."""


def find_corners(walls: Array, index: WallIndex) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """Find the corners of walls, shape (n, 4), in the order in which the ends of the walls come upon them.

    Returns
    -------
    corners : where exactly two walls end, not in one straight or curved line, and no third one passes, shape (k, 2)
        [m].
    opening_angles : angle between the two walls of each corner, in (0, pi - :data:`BLUNT`), shape (k,) [rad].
    corner_walls : indices of the two walls of each corner, ascending, shape (k, 2).
    """
    points = walls.reshape(-1, 2)
    pairs = _meeting_walls(*index, points)
    at = np.flatnonzero(pairs[:, 0] >= 0)
    ends = walls[pairs[at]].reshape(-1, 2, 2, 2)
    distances = np.linalg.norm(ends - points[at, None, None], axis=3)
    near = distances.argmin(axis=2)[..., None, None]
    ends_there = (distances.min(axis=2) <= TOUCH).all(axis=1)
    leaving = (np.take_along_axis(ends, 1 - near, axis=2) - np.take_along_axis(ends, near, axis=2))[:, :, 0]
    first, second = leaving[:, 0], leaving[:, 1]
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    opening_angles = np.abs(np.arctan2(cross, (first * second).sum(axis=1)))
    kept = np.flatnonzero(ends_there & (opening_angles > STRAIGHT) & (opening_angles < np.pi - BLUNT))
    # Each corner was found from both of its walls.
    kept = kept[np.sort(np.unique(pairs[at[kept]], axis=0, return_index=True)[1])]
    return points[at[kept]], opening_angles[kept], pairs[at[kept]]


@kernel(f8[:, ::1], i8[::1], f8[:, ::1], i8[::1], f8[:, ::1])
def _meeting_walls(boxes, bounds, walls, ids, points):
    """Return the two walls that each point lies on, ascending, shape (p, 2); -1 where they are not exactly two."""
    pairs = np.full((len(points), 2), -1)
    stack = np.empty(64, np.int64)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        low = high = -1
        met = 0
        depth = 1
        stack[0] = 0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if x < boxes[node, 0] - TOUCH or x > boxes[node, 2] + TOUCH:
                continue
            if y < boxes[node, 1] - TOUCH or y > boxes[node, 3] + TOUCH:
                continue
            leaf = node - (bounds.size - 2)
            if leaf < 0:
                stack[depth], stack[depth + 1] = 2 * node + 1, 2 * node + 2
                depth += 2
                continue
            for k in range(bounds[leaf], bounds[leaf + 1]):
                ax, ay, bx, by = walls[k, 0] - x, walls[k, 1] - y, walls[k, 2] - x, walls[k, 3] - y
                ex, ey = bx - ax, by - ay
                share = min(1.0, max(0.0, -(ax * ex + ay * ey) / (ex * ex + ey * ey)))
                if np.hypot(ax + share * ex, ay + share * ey) <= TOUCH:
                    met += 1
                    low, high = (ids[k], low) if ids[k] < low or low < 0 else (low, ids[k])
        if met == 2:
            pairs[i, 0], pairs[i, 1] = low, high
    return pairs
