# pyright: standard
"""Exact ranges from one or many sensors to the walls around them.

These rules decide what a beam hits:

- A beam through a vertex hits: walls that share a vertex exactly leave no gap between them.
- A beam along a wall hits its nearer end.
- Of walls that a beam hits at the same range, the one of the lowest number is hit.
- A wall has no thickness and no inside: it is hit from either side, and a sensor within a closed polygon sees it from
  within.
- A sensor on a wall (:data:`ON_WALL`) is covered by it in every direction: every range is 0. Of several such walls, the
  one of the lowest number is hit.
"""

import numpy as np
import numpy.typing as npt
from numba import f8, i8

from features.compiled import READ_ONLY, READ_ONLY_ROWS, inner, kernel
from features.se2 import Array
from sim.casting.beam_sectors import (
    BLOCK,
    SLACK,
    box_sectors,
    hidden,
    hit_range,
    sector_count,
    sort_beams,
    try_wall,
    wall_sectors,
)
from sim.casting.sincos import MAX_ANGLE, sincos
from sim.casting.wall_index import WallIndex

ON_WALL = 1e-9
"""A sensor nearer to a wall than this is on it [m]: far above the rounding of coordinates of a kilometre (1e-13 m), far
below any distance that matters."""

_STACK = 64
"""Size of the stack of nodes still to visit: enough for a tree of 2^62 leaves, deeper than memory allows."""

WallIds = npt.NDArray[np.int64]


def cast_scans(index: WallIndex, poses_world_sensor: Array, angles: Array) -> tuple[Array, WallIds]:
    """Cast one scan, the same beams, from each of many poses.

    The tree is traversed from near to far. A box or wall is skipped where every beam towards it already ends before it,
    so that hidden walls cost next to nothing.

    Parameters
    ----------
    index : tree of the walls.
    poses_world_sensor : shape (m, 3) [m, m, rad].
    angles : direction of each beam, in any order, sensor frame, shape (k,) [rad].

    Returns
    -------
    ranges : shape (m, k) [m]; inf where no wall is hit.
    wall_ids : number of the wall that is hit, shape (m, k); -1 where none is.

    Raises
    ------
    ValueError
        A shape is wrong, a value is not finite, or the direction of a beam is beyond 1e6 rad.
    """
    poses = np.ascontiguousarray(poses_world_sensor, dtype=np.float64)
    angles = np.ascontiguousarray(angles, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[1] != 3 or angles.ndim != 1:
        raise ValueError(f"expected poses of shape (m, 3) and angles of (k,), got {poses.shape} and {angles.shape}")
    ranges, wall_ids, usable = _cast_scans(*index, poses, angles)
    if not usable:
        raise ValueError(f"poses and angles must be finite, and no direction beyond {MAX_ANGLE:g} rad")
    return ranges, wall_ids


def cast_beams(index: WallIndex, poses_world_sensor: Array, angles: Array) -> tuple[Array, WallIds]:
    """Cast single beams, each from a pose of its own.

    Parameters
    ----------
    index : tree of the walls.
    poses_world_sensor : pose of the sensor at each beam, shape (k, 3) [m, m, rad].
    angles : direction of each beam, sensor frame, shape (k,) [rad].

    Returns
    -------
    ranges : shape (k,) [m]; inf where no wall is hit.
    wall_ids : number of the wall that is hit, shape (k,); -1 where none is.

    Raises
    ------
    ValueError
        A shape is wrong, a value is not finite, or the direction of a beam is beyond 1e6 rad.
    """
    poses = np.ascontiguousarray(poses_world_sensor, dtype=np.float64)
    angles = np.ascontiguousarray(angles, dtype=np.float64)
    if angles.ndim != 1 or poses.shape != (angles.size, 3):
        raise ValueError(f"expected poses of shape (k, 3) and angles of (k,), got {poses.shape} and {angles.shape}")
    ranges, wall_ids, usable = _cast_beams(*index, poses, poses[:, 2] + angles)
    if not usable:
        raise ValueError(f"poses and angles must be finite, and no direction beyond {MAX_ANGLE:g} rad")
    return ranges, wall_ids


@inner()
def _push_children(boxes, node, x, y, stack, near, depth):
    """Push both children with their squared distances, the nearer one on top; return the new depth of the stack."""
    left, right = 2 * node + 1, 2 * node + 2
    near_left, near_right = _box_distance(boxes, left, x, y), _box_distance(boxes, right, x, y)
    if near_left < near_right:
        left, right = right, left
        near_left, near_right = near_right, near_left
    stack[depth], near[depth] = left, near_left
    stack[depth + 1], near[depth + 1] = right, near_right
    return depth + 2


@inner()
def _hit_box(boxes, node, x, y, c, s):
    """Whether the beam from (x, y) in direction (c, s) hits a box, which is widened by a little more than rounding."""
    half_x, half_y = 0.5 * (boxes[node, 2] - boxes[node, 0]), 0.5 * (boxes[node, 3] - boxes[node, 1])
    dx, dy = boxes[node, 0] + half_x - x, boxes[node, 1] + half_y - y
    slack = 2.0 * ON_WALL + 1e-12 * (abs(dx) + abs(dy) + half_x + half_y)
    aside, ahead = c * dy - s * dx, c * dx + s * dy
    return (
        abs(aside) <= half_x * abs(s) + half_y * abs(c) + slack and -ahead <= half_x * abs(c) + half_y * abs(s) + slack
    )


@inner()
def _box_distance(boxes, node, x, y):
    """Return the squared distance of a point to a box [m^2]."""
    dx = max(boxes[node, 0] - x, 0.0, x - boxes[node, 2])
    dy = max(boxes[node, 1] - y, 0.0, y - boxes[node, 3])
    return dx * dx + dy * dy


@inner()
def _squared_distance(ax, ay, bx, by):
    """Return the squared distance of the wall from a to b to the origin [m^2]."""
    ex, ey = bx - ax, by - ay
    share = min(1.0, max(0.0, -(ax * ex + ay * ey) / (ex * ex + ey * ey)))
    dx, dy = ax + share * ex, ay + share * ey
    return dx * dx + dy * dy


@kernel(f8[:, ::1], i8[::1], f8[:, ::1], i8[::1], READ_ONLY_ROWS, READ_ONLY)
def _cast_scans(boxes, bounds, walls, ids, poses, angles):
    n = angles.size
    all_ranges = np.empty((len(poses), n))
    all_ids = np.empty((len(poses), n), np.int64)
    sectors = sector_count(n)
    cosines, sines = np.empty(n), np.empty(n)
    blocks = (n + BLOCK - 1) // BLOCK
    # The entries that pad the last block have no direction: they hit nothing, and are never the farthest.
    sorted_cosines, sorted_sines = np.zeros(BLOCK * blocks), np.zeros(BLOCK * blocks)
    ranges, hits = np.empty(BLOCK * blocks), np.empty(BLOCK * blocks, np.int64)
    slots = np.empty(n, np.uint32)
    firsts = np.empty(sectors + 2, np.uint32)
    far = np.empty(blocks)
    stack, near = np.empty(_STACK, np.int64), np.empty(_STACK)
    for row in range(len(poses)):
        x, y, heading = poses[row, 0], poses[row, 1], poses[row, 2]
        if not (sincos(angles, heading, cosines, sines) and np.isfinite(x) and np.isfinite(y)):
            return all_ranges, all_ids, False
        sort_beams(cosines, sines, sorted_cosines, sorted_sines, slots, firsts)
        far[:] = np.inf
        ranges[:n] = np.inf
        ranges[n:] = -1.0
        hits[:] = -1
        covering = -1
        depth = 1
        stack[0], near[0] = 0, 0.0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if near[depth] > ON_WALL * ON_WALL:
                first, last = box_sectors(
                    boxes[node, 0] - x, boxes[node, 1] - y, boxes[node, 2] - x, boxes[node, 3] - y, sectors
                )
                if hidden(firsts, far, first, last, near[depth]):
                    continue
            leaf = node - (bounds.size - 2)
            if leaf < 0:
                depth = _push_children(boxes, node, x, y, stack, near, depth)
                continue
            for k in range(bounds[leaf], bounds[leaf + 1]):
                ax, ay, bx, by = walls[k, 0] - x, walls[k, 1] - y, walls[k, 2] - x, walls[k, 3] - y
                distance = _squared_distance(ax, ay, bx, by)
                if distance <= ON_WALL * ON_WALL:
                    covering = ids[k] if covering < 0 else min(covering, ids[k])
                    continue
                first, last = wall_sectors(ax, ay, bx, by, sectors)
                if hidden(firsts, far, first, last, distance):
                    continue
                begin, end = firsts[first], firsts[last + np.uint32(1)]
                if first > last:
                    try_wall(
                        sorted_cosines, sorted_sines, ranges, hits, far, begin, np.uint32(n), ax, ay, bx, by, ids[k]
                    )
                    begin = np.uint32(0)
                try_wall(sorted_cosines, sorted_sines, ranges, hits, far, begin, end, ax, ay, bx, by, ids[k])
        for i in range(n):
            all_ranges[row, i] = ranges[slots[i]] if covering < 0 else 0.0
            all_ids[row, i] = hits[slots[i]] if covering < 0 else covering
    return all_ranges, all_ids, True


@kernel(f8[:, ::1], i8[::1], f8[:, ::1], i8[::1], READ_ONLY_ROWS, READ_ONLY)
def _cast_beams(boxes, bounds, walls, ids, poses, directions):
    n = directions.size
    ranges, hits = np.full(n, np.inf), np.full(n, -1)
    cosines, sines = np.empty(n), np.empty(n)
    if not sincos(directions, 0.0, cosines, sines):
        return ranges, hits, False
    stack, near = np.empty(_STACK, np.int64), np.empty(_STACK)
    for i in range(n):
        x, y, c, s = poses[i, 0], poses[i, 1], cosines[i], sines[i]
        if not (np.isfinite(x) and np.isfinite(y)):
            return ranges, hits, False
        depth = 1
        stack[0], near[0] = 0, 0.0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if near[depth] * SLACK > ranges[i] * ranges[i] + ON_WALL * ON_WALL or not _hit_box(boxes, node, x, y, c, s):
                continue
            leaf = node - (bounds.size - 2)
            if leaf < 0:
                depth = _push_children(boxes, node, x, y, stack, near, depth)
                continue
            for k in range(bounds[leaf], bounds[leaf + 1]):
                ax, ay, bx, by = walls[k, 0] - x, walls[k, 1] - y, walls[k, 2] - x, walls[k, 3] - y
                on_wall = _squared_distance(ax, ay, bx, by) <= ON_WALL * ON_WALL
                hit = 0.0 if on_wall else hit_range(c, s, ax, ay, bx, by)
                if hit < ranges[i] or (hit == ranges[i] and ids[k] < hits[i]):
                    ranges[i], hits[i] = hit, ids[k]
    return ranges, hits, True
