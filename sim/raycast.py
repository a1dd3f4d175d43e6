"""Exact ranges from a point to the walls around it."""

import math

import numba
import numpy as np
import numpy.typing as npt

from features.se2 import Array

ON_WALL = 1e-9
"""A sensor nearer to a wall than this stands on it [m]."""

_MARGIN = 1e-6
"""Widens the angular interval of a wall, so that rounding never keeps a beam from being tried [rad]."""


def cast(walls: Array, origin: Array, angles: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """Range to the nearest wall along each beam.

    The beams are put in order of direction, and each wall is tried only on the beams in its angular interval; whether
    a beam hits is decided by the sides on which the wall's ends lie of it, and the hit is a point of the wall itself.

    - A beam through a vertex hits: walls that share a vertex exactly leave no gap between them.
    - A beam along a wall hits its nearer end.
    - A sensor on a wall (:data:`ON_WALL`) is covered by it: every range is 0.

    Parameters
    ----------
    walls : end points ``x1 y1 x2 y2``, shape (n, 4), world frame [m].
    origin : position of the sensor, shape (2,), world frame [m].
    angles : direction of each beam, in any order, world frame, shape (k,) [rad].

    Returns
    -------
    ranges : shape (k,) [m]; inf where no wall is hit.
    wall_ids : index of the wall that is hit, shape (k,); -1 where none is.

    Raises
    ------
    ValueError
        ``walls`` is not of shape (n, 4), ``origin`` not of (2,) or ``angles`` not of (k,), or one is not finite.
    """
    walls = np.ascontiguousarray(walls, dtype=np.float64)
    angles = np.asarray(angles, dtype=np.float64)
    x, y = np.asarray(origin, dtype=np.float64)
    if walls.ndim != 2 or walls.shape[1] != 4 or angles.ndim != 1:
        raise ValueError(f"expected walls (n, 4) and angles (k,), got {walls.shape} and {angles.shape}")
    if not (np.isfinite(walls).all() and np.isfinite(angles).all() and math.isfinite(x) and math.isfinite(y)):
        raise ValueError("walls, origin and angles must be finite")
    # As se2.wrap_angle, but a fifth of its time: there it would be a third of the whole cast.
    headings = angles - 2.0 * math.pi * np.floor(angles / (2.0 * math.pi) + 0.5)
    order = np.argsort(headings, kind="stable")
    return _cast(walls, float(x), float(y), headings[order], order, np.cos(angles), np.sin(angles))


@numba.njit(cache=True)
def _cast(walls, x, y, headings, order, cosines, sines):
    """Lay each wall on the beams of its angular interval; ``headings`` ascend, ``order`` names their beams."""
    n = headings.size
    ranges = np.full(n, np.inf)
    wall_ids = np.full(n, -1)
    for wall in range(walls.shape[0]):
        ax, ay = walls[wall, 0] - x, walls[wall, 1] - y
        bx, by = walls[wall, 2] - x, walls[wall, 3] - y
        if _distance(ax, ay, bx, by) <= ON_WALL:
            ranges[:] = 0.0
            wall_ids[:] = wall
            break
        start = math.atan2(ay, ax)
        width = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        if width < 0.0:
            start += width
            width = -width
        start -= _MARGIN
        width += 2.0 * _MARGIN
        if start < -math.pi:
            start += 2.0 * math.pi
        first = np.searchsorted(headings, start)
        for k in range(n):
            i = first + k
            ahead = headings[i] - start if i < n else headings[i - n] - start + 2.0 * math.pi
            if ahead > width:
                break
            beam = order[i if i < n else i - n]
            c, s = cosines[beam], sines[beam]
            side_a, side_b = c * ay - s * ax, c * by - s * bx
            if (side_a > 0.0 and side_b > 0.0) or (side_a < 0.0 and side_b < 0.0):
                continue
            along_a, along_b = c * ax + s * ay, c * bx + s * by
            if side_a == side_b:
                hit = min(along_a, along_b)
            else:
                share = side_a / (side_a - side_b)
                hit = (1.0 - share) * along_a + share * along_b
            if 0.0 < hit < ranges[beam]:
                ranges[beam] = hit
                wall_ids[beam] = wall
    return ranges, wall_ids


@numba.njit(cache=True)
def _distance(ax, ay, bx, by):
    """Distance of the segment from a to b to the origin [m]."""
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    share = min(1.0, max(0.0, -(ax * ex + ay * ey) / square)) if square > 0.0 else 0.0
    return math.hypot(ax + share * ex, ay + share * ey)
