"""The search by walls: as brute force finds it, unique or not, at a bounded cost."""

import math
from dataclasses import replace

import numpy as np
import pytest

from features.se2 import inverse, pose, rotate_each, transform, wrap_angle
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


@pytest.mark.slow
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


WIDE = np.diag([1.0, 1.0, math.radians(5.0)]) ** 2
"""Positions up to 3.5 m off, and headings up to 17 deg."""


def submap_at(walls, at, rules):
    return np.ascontiguousarray(transform(inverse(at), wall_samples(walls, rules)))


@pytest.mark.parametrize("seed", range(6))
def test_a_place_is_found_metres_off_and_is_the_only_one(seed):
    rng = np.random.default_rng(seed)
    walls, rules = scattered(rng, 40), WallSearchRules()
    here = pose(2.0, -1.0, 0.7)
    off = rng.uniform([-2.0, -2.0, -0.15], [2.0, 2.0, 0.15])
    found = search(submap_at(walls, here, rules), walls, Region(here + off, WIDE, GATE), 0.9, rules)
    assert found.unique
    assert found.pose is not None
    assert np.hypot(*(found.pose - here)[:2]) <= 2.0 * rules.cell
    assert abs(found.pose[2] - here[2]) <= rules.same_heading / 2.0


def test_a_place_that_is_there_twice_is_not_unique():
    rng = np.random.default_rng(1)
    rules = WallSearchRules()
    walls = scattered(rng, 15, size=2.0)
    copy = walls.copy()
    copy[:, WALL_X] += 3.0
    both = np.concatenate([walls, copy])
    points = submap_at(walls, pose(), rules)
    region = Region(pose(1.5), WIDE, GATE)
    assert search(points, walls, region, 0.9, rules).unique
    twice = search(points, both, region, 0.9, rules)
    assert twice.pose is not None
    assert not twice.unique


def test_a_corridor_is_nowhere_unique():
    rules = WallSearchRules()
    sides = walls_of([[[-30.0, 1.0], [30.0, 1.0]], [[30.0, -1.0], [-30.0, -1.0]]])
    seen = walls_of([[[-4.0, 1.0], [4.0, 1.0]], [[4.0, -1.0], [-4.0, -1.0]]])
    found = search(wall_samples(seen, rules), sides, Region(pose(1.0), WIDE, GATE), 0.6, rules)
    assert found.pose is not None
    assert not found.unique


@pytest.mark.parametrize(("share", "there"), [(0.45, True), (0.55, False)])
def test_no_place_has_less_than_the_share_that_is_asked_for(share, there):
    """Half of what is seen lies on the walls, to within what a cell is wide."""
    rules = WallSearchRules()
    walls = walls_of([[[0.0, 0.0], [4.0, 0.0]]])
    seen = walls_of([[[0.0, 0.0], [8.0, 0.0]]])
    still = Region(pose(), np.diag([1e-4, 1e-4, 1e-6]), GATE)
    points = wall_samples(seen, rules)
    found = search(points, walls, still, share, replace(rules, cell=0.05))
    assert (found.pose is not None) == there


def test_a_search_that_would_cost_too_much_says_nothing():
    """The place is there; with fewer blocks than it takes it is not found, or at least not called the only one."""
    rng = np.random.default_rng(0)
    walls, rules = scattered(rng, 40), WallSearchRules()
    points = submap_at(walls, pose(), rules)
    region = Region(pose(1.0, -1.0, 0.1), WIDE, GATE)
    assert search(points, walls, region, 0.9, rules).unique
    assert search(points, walls, region, 0.9, replace(rules, most_nodes=10)).pose is None
    sure = [search(points, walls, region, 0.9, replace(rules, most_nodes=2**k)).unique for k in range(16)]
    assert sure == sorted(sure)
    assert not sure[0]
    assert sure[-1]


def test_a_wall_counts_once_however_often_it_was_seen():
    rules = WallSearchRules()
    wall = walls_of([[[0.01, 0.1], [3.99, 0.1]]])
    once = wall_samples(wall, rules)
    assert len(once) == 20
    np.testing.assert_allclose(once[:, 1], 0.1)
    np.testing.assert_array_equal(wall_samples(np.tile(wall, (7, 1)), rules), once)
    assert len(wall_samples(wall, replace(rules, most_points=9))) <= 9
