"""Scans of 920 beams among 100 to 10,000 walls, from ten places each, beside all pairs in numpy.

Two kinds of world: a building (rooms of 4 m to 8 m with a door of 0.9 m in every inner wall, filled up with boxes of
0.4 m to 1.2 m that stand in them at any angle), where a scan shows some 20 walls; and an open field of single walls,
0.5 m to 2 m long, at random, one for every 4 square metres, where it shows some 70.
"""

import itertools

import numpy as np
import pytest

from sim.worlds.world import World

ANGLES = np.linspace(-np.pi, np.pi, 920, endpoint=False)
COUNTS = [100, 1_000, 10_000]
DOOR = 0.9
SCANS = 10


def building(count):
    """World of this many walls, and its extent [m]."""
    rng = np.random.default_rng(0)
    rooms = int(np.ceil(np.sqrt(count / 8)))
    xs, ys = (np.concatenate([[0.0], np.cumsum(rng.uniform(4.0, 8.0, rooms))]) for _ in range(2))
    walls = []
    for line, (at, along) in itertools.product(range(rooms + 1), (enumerate((xs, ys)))):
        across = (ys, xs)[at]
        for low, high in itertools.pairwise(across):
            door = rng.uniform(low + 0.5, high - 0.5 - DOOR)
            inner = 0 < line < rooms
            for start, end in [(low, door), (door + DOOR, high)] if inner else [(low, high)]:
                ends = [(along[line], start), (along[line], end)]
                walls.append(np.ravel(ends if at == 0 else [end[::-1] for end in ends]))
    cells = itertools.cycle(itertools.product(range(rooms), repeat=2))
    while len(walls) < count:
        i, j = next(cells)
        centre = rng.uniform([xs[i] + 0.9, ys[j] + 0.9], [xs[i + 1] - 0.9, ys[j + 1] - 0.9])
        (a, b), turn = rng.uniform(0.2, 0.6, 2), rng.uniform(0.0, np.pi)
        axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        box = centre + np.array([[a, b], [-a, b], [-a, -b], [a, -b]]) @ axes
        walls.extend(np.hstack([box, np.roll(box, -1, axis=0)]))
    return World(f"building-{count}", np.array(walls[:count])), np.array([xs[-1], ys[-1]])


def field(count):
    """World of this many walls, and its extent [m]."""
    rng = np.random.default_rng(0)
    side = np.sqrt(4.0 * count)
    middles, turns, halves = (
        rng.uniform(0.0, side, (count, 2)),
        rng.uniform(0.0, np.pi, count),
        rng.uniform(0.25, 1.0, count),
    )
    arms = halves[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    return World(f"field-{count}", np.hstack([middles - arms, middles + arms])), np.array([side, side])


def places(extent):
    """Poses in the middle part of a world, shape (10, 3)."""
    low, high = np.append(0.2 * extent, -np.pi), np.append(0.8 * extent, np.pi)
    return np.random.default_rng(1).uniform(low, high, (SCANS, 3))


def cast_all_pairs(walls, pose, angles):
    """Intersect every beam with every wall in one numpy expression."""
    starts, along = walls[:, :2] - pose[:2], walls[:, 2:] - walls[:, :2]
    dx, dy = np.cos(pose[2] + angles)[:, None], np.sin(pose[2] + angles)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = dx * along[:, 1] - dy * along[:, 0]
        distance = (starts[:, 0] * along[:, 1] - starts[:, 1] * along[:, 0]) / crossing
        share = (starts[:, 0] * dy - starts[:, 1] * dx) / crossing
    hit = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    return np.where(hit, distance, np.inf).min(axis=1)


def report_rate(benchmark):
    if benchmark.stats is not None:
        rays = SCANS * ANGLES.size
        benchmark.extra_info["million_rays_per_second"] = round(rays / benchmark.stats.stats.median / 1e6, 2)


@pytest.fixture(
    scope="module", params=itertools.product([building, field], COUNTS), ids=lambda p: f"{p[0].__name__}-{p[1]}"
)
def scene(request):
    """World, poses and the group of its benchmarks."""
    make, count = request.param
    world, extent = make(count)
    return world, places(extent), f"ray casting, {SCANS} scans of 920 beams, {make.__name__} of {count} walls"


def test_cast(benchmark, scene):
    """One scan after the other."""
    world, poses, benchmark.group = scene
    ranges = benchmark(lambda: [world.cast(pose, ANGLES)[0] for pose in poses])
    report_rate(benchmark)
    # The plain solution subtracts coordinates as large as the world.
    fair = 1e-9 * max(1.0, abs(world.walls).max())
    np.testing.assert_allclose(ranges[0], cast_all_pairs(world.walls, poses[0], ANGLES), rtol=0, atol=fair)


def test_cast_batch(benchmark, scene):
    """All scans in one call."""
    world, poses, benchmark.group = scene
    ranges, _ = benchmark(world.cast_batch, poses, ANGLES)
    report_rate(benchmark)
    np.testing.assert_array_equal(ranges[-1], world.cast(poses[-1], ANGLES)[0])


def test_cast_beams(benchmark, scene):
    """Each beam from a pose of its own."""
    world, poses, benchmark.group = scene
    poses, angles = np.repeat(poses, ANGLES.size, axis=0), np.tile(ANGLES, SCANS)
    ranges, _ = benchmark(world.cast_beams, poses, angles)
    report_rate(benchmark)
    np.testing.assert_array_equal(ranges[: ANGLES.size], world.cast(poses[0], ANGLES)[0])


def test_cast_numpy_all_pairs(benchmark, scene):
    world, poses, benchmark.group = scene
    rounds = 2 if len(world.walls) > 1000 else 10
    benchmark.pedantic(lambda: [cast_all_pairs(world.walls, pose, ANGLES) for pose in poses], rounds=rounds)
    report_rate(benchmark)


@pytest.mark.benchmark(group="a world of 10000 walls")
def test_world_of_10000_walls(benchmark):
    """The index and the corners."""
    world, _ = building(10_000)
    assert len(benchmark(World, "again", world.walls).corners) > 1_000
