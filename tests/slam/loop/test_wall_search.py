"""The search by walls: as brute force finds it, unique or not, at a bounded cost."""

import math
from dataclasses import replace

import numpy as np
import pytest

from features.se2 import pose, rotate_each, transform, wrap_angle
from slam.loop.rules import WallSearchRules
from slam.loop.wall_search import Region, search, wall_samples
from slam.odometry.line_map import LENGTH, NORMAL_X, NORMAL_Y, WALL_FIELDS, WALL_X, WALL_Y

GATE = 12.0


def walls_of(ends):
    """Walls of segments, shape (m, 2, 2)."""
    ends = np.asarray(ends, np.float64)
    along = ends[:, 1] - ends[:, 0]
    walls = np.zeros((len(ends), WALL_FIELDS))
    walls[:, [WALL_X, WALL_Y]] = ends.mean(axis=1)
    walls[:, LENGTH] = np.hypot(*along.T)
    walls[:, [NORMAL_X, NORMAL_Y]] = along[:, ::-1] * [1.0, -1.0] / walls[:, LENGTH, None]
    return walls


def scattered(rng, count, size=8.0):
    starts = rng.uniform(-size, size, (count, 2))
    directions = rng.uniform(-math.pi, math.pi, count)
    arms = rng.uniform(0.5, 3.0, (count, 1)) * np.column_stack([np.cos(directions), np.sin(directions)])
    return walls_of(np.stack([starts, starts + arms], axis=1))


def seen_from(points_map, at):
    return rotate_each(points_map - at[:2], np.full(len(points_map), -at[2]))


def on_walls(points, walls, cell):
    """Which points, map frame, lie in cells near walls, by the distance of the middle of the cell; low end as given."""
    half = 0.5 * walls[:, LENGTH, None] * np.abs(walls[:, [NORMAL_Y, NORMAL_X]])
    low = (walls[:, [WALL_X, WALL_Y]] - half).min(axis=0)
    middles = low + (np.floor((points - low) / cell + 1e-12) + 0.5) * cell
    arms = middles[:, None] - walls[None, :, [WALL_X, WALL_Y]]
    along = walls[:, [NORMAL_Y, NORMAL_X]] * [-1.0, 1.0]
    on = np.clip((arms * along).sum(axis=2), -0.5 * walls[:, LENGTH], 0.5 * walls[:, LENGTH])
    return (np.hypot(*np.moveaxis(arms - on[..., None] * along, 2, 0)) <= cell).any(axis=1)


def covariance(rng):
    root = rng.normal(size=(3, 3)) * np.array([[0.3], [0.3], [0.05]])
    return root @ root.T + np.diag([0.05, 0.05, 1e-3])


@pytest.mark.parametrize("seed", range(6))
def test_branch_and_bound_finds_what_brute_force_finds(seed):
    rng = np.random.default_rng(seed)
    walls, rules = scattered(rng, 25), WallSearchRules()
    region = Region(pose(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0)), covariance(rng), GATE)
    points = rng.uniform(-4.0, 4.0, (60, 2))
    found = search(points, walls, region, 0.0, rules).pose
    assert found is not None

    def score(at):
        turned = rotate_each(points, np.full(len(points), at[2])) + at[:2]
        return int(on_walls(turned, walls, rules.cell).sum())

    def distance2(at):
        slip = at - region.pose
        slip[2] = wrap_angle(float(slip[2]))
        return slip @ np.linalg.solve(region.cov, slip)

    turn = rules.cell / np.hypot(*points.T).max()
    slope = region.cov[:2, 2] / region.cov[2, 2]
    most = 0
    steps = np.arange(-40, 41)
    for k in steps:
        middle = region.pose + k * turn * np.array([*slope, 1.0])
        if GATE * region.cov[2, 2] < (k * turn) ** 2:
            continue
        for i in steps:
            for j in steps:
                at = middle + rules.cell * np.array([i, j, 0.0])
                if distance2(at.copy()) <= GATE:
                    most = max(most, score(at))
    assert score(found) == most
    assert distance2(found.copy()) <= GATE * (1.0 + 1e-9)
