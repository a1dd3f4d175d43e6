# pyright: standard
"""Search for a place by walls: where a submap lies on walls seen before, by branch and bound over a region of poses."""

import math
from dataclasses import dataclass

import numpy as np
from numba import f8, i8, u1
from numpy.typing import NDArray

from features.compiled import inner, kernel
from features.se2 import Array, Pose, rotate_each, wrap_angle
from slam.loop.rules import WallSearchRules
from slam.odometry.line_map import LENGTH, NORMAL_X, NORMAL_Y, WALL_X, WALL_Y


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Poses that a covariance allows for: an ellipsoid of x, y and theta.

    Parameters
    ----------
    pose : middle, shape (3,) [m, m, rad].
    cov : covariance of its coordinates, shape (3, 3).
    gate : largest squared Mahalanobis distance.
    """

    pose: Pose
    cov: Array
    gate: float

    @property
    def reach(self) -> float:
        """Distance from the middle to the farthest position [m]."""
        return math.sqrt(self.gate * float(np.linalg.eigvalsh(self.cov[:2, :2])[1]))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Outcome of a search.

    Parameters
    ----------
    pose : the best one, shape (3,); None where none has the share that is asked for, or the search was given up.
    unique : whether no pose elsewhere in the region explains nearly as much, and the search was finished.
    """

    pose: Pose | None
    unique: bool


def wall_samples(walls: Array, rules: WallSearchRules) -> Array:
    """Points on walls, shape (m, WALL_FIELDS), one in each cell that a wall passes, shape (n, 2) [m].

    As each stretch of wall counts once, however often it was seen, near walls do not outweigh far ones.
    """
    counts = np.maximum(np.ceil(walls[:, LENGTH] / rules.cell), 1.0).astype(np.int64)
    owner = np.repeat(np.arange(len(walls)), counts)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = ((number + 0.5) / counts[owner] - 0.5) * walls[owner, LENGTH]
    tangents = walls[:, [NORMAL_Y, NORMAL_X]] * [-1.0, 1.0]
    points = walls[owner][:, [WALL_X, WALL_Y]] + along[:, None] * tangents[owner]
    _, first = np.unique(np.floor(points / rules.cell).astype(np.int64), axis=0, return_index=True)
    first = np.sort(first)
    return np.ascontiguousarray(points[first[:: len(first) // rules.most_points + 1]])


def search(points: Array, walls: Array, region: Region, share: float, rules: WallSearchRules) -> Found:
    """Find the pose in a region at which most points lie on walls (eq. M55-M57).

    Parameters
    ----------
    points : of the submap, in the frame of the pose that is searched for, shape (n, 2), n >= 1 [m].
    walls : map frame, shape (m, WALL_FIELDS), m >= 1.
    region : poses that are possible, map frame.
    share : of the points those that lie on walls, at least.
    rules : resolution, and what bounds the cost.
    """
    cell = rules.cell
    turn = cell / max(float(np.hypot(*points.T).max()), cell)
    sigma = math.sqrt(region.cov[2, 2])
    half = math.floor(min(math.sqrt(region.gate) * sigma, math.pi) / turn)
    turns = turn * np.arange(-half, half + 1)
    # The position that is likeliest at each heading, and the covariance about it.
    slope = region.cov[:2, 2] / region.cov[2, 2]
    about = region.cov[:2, :2] - np.outer(slope, region.cov[2, :2])
    gates = region.gate - (turns / sigma) ** 2
    middles = region.pose[:2] + turns[:, None] * slope
    halves = np.floor(np.sqrt(np.maximum(gates, 0.0)[:, None] * np.diag(about)) / cell).astype(np.int64)
    blocks = 2**rules.levels
    tops = int((-(-(2 * halves + 1) // blocks)).prod(axis=1).sum())
    if tops > rules.most_nodes:
        return Found(None, False)
    grids, origin = _pyramid(walls, cell, rules.levels)
    cells = np.empty((len(turns), len(points), 2), np.int64)
    for at, each in enumerate(turns):
        turned = rotate_each(points, np.full(len(points), region.pose[2] + each))
        cells[at] = np.floor((turned + middles[at] - origin) / cell)
    information = np.linalg.inv(about)

    def run(least: int, most_nodes: int, apart: Array) -> tuple[Pose | None, int, int]:
        score, nodes, at, i, j = _search(
            grids, cells, turns, middles, halves, gates, information, tops, cell, least, most_nodes, apart,
            rules.same_position, rules.same_heading,
        )  # fmt: skip
        found = np.array([*(middles[at] + cell * np.array([i, j])), wrap_angle(float(region.pose[2] + turns[at]))])
        return (found if score >= least else None), score, nodes

    everywhere = np.empty(0)
    best, score, nodes = run(max(math.ceil(share * len(points)), 1), rules.most_nodes, everywhere)
    if best is None or nodes >= rules.most_nodes:
        return Found(None, False)
    relative = np.array([*best[:2], wrap_angle(float(best[2] - region.pose[2]))])
    rival, _, more = run(max(math.ceil(rules.rival * score), 1), rules.most_nodes - nodes, relative)
    return Found(best, rival is None and nodes + more < rules.most_nodes)


def _pyramid(walls: Array, cell: float, levels: int) -> tuple[NDArray[np.uint8], Array]:
    """Grids of cells near a wall, the maxima of 2**h by 2**h cells at level h; and the position of the first cell."""
    half = 0.5 * walls[:, LENGTH, None] * np.abs(walls[:, [NORMAL_Y, NORMAL_X]])
    middles = walls[:, [WALL_X, WALL_Y]]
    # A block of the top level that begins before the walls may reach them.
    margin = (2**levels + 1) * cell
    low, high = (middles - half).min(axis=0) - margin, (middles + half).max(axis=0) + 2.0 * cell
    grids = np.zeros((levels + 1, *np.ceil((high - low) / cell).astype(np.int64)), np.uint8)
    _draw(grids, np.ascontiguousarray(walls), low[0], low[1], cell)
    return grids, low


@kernel(u1[:, :, ::1], f8[:, ::1], f8, f8, f8)
def _draw(grids, walls, low_x, low_y, cell):
    _, width, height = grids.shape
    for k in range(len(walls)):
        x = (walls[k, WALL_X] - low_x) / cell
        y = (walls[k, WALL_Y] - low_y) / cell
        along_x, along_y = -walls[k, NORMAL_Y], walls[k, NORMAL_X]
        half = 0.5 * walls[k, LENGTH] / cell
        steps = math.ceil(2.0 * half) + 1
        for step in range(steps):
            way = -half + 2.0 * half * step / max(steps - 1, 1)
            at_x, at_y = x + way * along_x, y + way * along_y
            for i in range(max(int(at_x) - 1, 0), min(int(at_x) + 2, width)):
                for j in range(max(int(at_y) - 1, 0), min(int(at_y) + 2, height)):
                    # Distance of the middle of the cell from the wall, in cells.
                    arm_x, arm_y = i + 0.5 - x, j + 0.5 - y
                    on = min(max(arm_x * along_x + arm_y * along_y, -half), half)
                    if math.hypot(arm_x - on * along_x, arm_y - on * along_y) <= 1.0:
                        grids[0, i, j] = 1
    for level in range(1, len(grids)):
        shift = 1 << (level - 1)
        for i in range(width):
            for j in range(height):
                most = grids[level - 1, i, j]
                if i + shift < width:
                    most = max(most, grids[level - 1, i + shift, j])
                if j + shift < height:
                    most = max(most, grids[level - 1, i, j + shift])
                    if i + shift < width:
                        most = max(most, grids[level - 1, i + shift, j + shift])
                grids[level, i, j] = most


@inner()
def _bound(grids, cells, at, i, j, level):
    """Points that lie on walls, at most, at the positions of a block."""
    _, width, height = grids.shape
    count = 0
    for k in range(cells.shape[1]):
        x, y = cells[at, k, 0] + i, cells[at, k, 1] + j
        if 0 <= x < width and 0 <= y < height:
            count += grids[level, x, y]
    return count


@kernel(
    u1[:, :, ::1], i8[:, :, ::1], f8[::1], f8[:, ::1], i8[:, ::1], f8[::1], f8[:, ::1], i8, f8, i8, i8, f8[::1],
    f8, f8,
)  # fmt: skip
def _search(
    grids, cells, turns, middles, halves, gates, information, tops, cell, least, most_nodes, apart, same_position,
    same_heading,
):  # fmt: skip
    """Best score of at least ``least``, evaluated nodes, and indices of the pose; away from ``apart``, if any is given.

    With ``apart`` the first pose that has the score is returned, as only its existence is asked for.
    """
    levels = len(grids) - 1
    block = 1 << levels
    roots = np.empty((tops, 3), np.int64)
    bounds = np.empty(tops, np.int64)
    nodes = 0
    for at in range(len(turns)):
        for i in range(-halves[at, 0], halves[at, 0] + 1, block):
            for j in range(-halves[at, 1], halves[at, 1] + 1, block):
                roots[nodes, 0], roots[nodes, 1], roots[nodes, 2] = at, i, j
                bounds[nodes] = _bound(grids, cells, at, i, j, levels)
                nodes += 1
    order = np.argsort(-bounds, kind="mergesort")
    stack = np.empty((4 * levels + 1, 5), np.int64)
    children = np.empty((4, 3), np.int64)
    best, best_at, best_i, best_j = least - 1, 0, 0, 0
    for root in order:
        if bounds[root] <= best:
            break
        stack[0, 0], stack[0, 1], stack[0, 2] = roots[root, 0], roots[root, 1], roots[root, 2]
        stack[0, 3], stack[0, 4] = levels, bounds[root]
        depth = 1
        while depth > 0:
            depth -= 1
            at, i, j, level, bound = stack[depth]
            if bound <= best:
                continue
            if level == 0:
                if abs(i) > halves[at, 0] or abs(j) > halves[at, 1]:
                    continue
                x, y = cell * i, cell * j
                form = information[0, 0] * x * x + 2.0 * information[0, 1] * x * y + information[1, 1] * y * y
                if form > gates[at]:
                    continue
                if len(apart) > 0:
                    near = math.hypot(middles[at, 0] + x - apart[0], middles[at, 1] + y - apart[1]) <= same_position
                    turn = (turns[at] - apart[2] + math.pi) % (2.0 * math.pi) - math.pi
                    if near and abs(turn) <= same_heading:
                        continue
                best, best_at, best_i, best_j = bound, at, i, j
                if len(apart) > 0:
                    return best, nodes, best_at, best_i, best_j
                continue
            half = 1 << (level - 1)
            for child in range(4):
                children[child, 0] = i + half * (child >> 1)
                children[child, 1] = j + half * (child & 1)
                children[child, 2] = _bound(grids, cells, at, children[child, 0], children[child, 1], level - 1)
            nodes += 4
            # The most promising one comes on top.
            for child in np.argsort(children[:, 2], kind="mergesort"):
                if children[child, 2] > best:
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = at, children[child, 0], children[child, 1]
                    stack[depth, 3], stack[depth, 4] = level - 1, children[child, 2]
                    depth += 1
            if nodes >= most_nodes:
                return best, nodes, best_at, best_i, best_j
    return best, nodes, best_at, best_i, best_j
