"""Meeting walls (eq. M103-M105): edges are corners; columns, bays and what stands off a wall have none."""

import math
from concurrent.futures import ThreadPoolExecutor

import extraction_twin
import numpy as np
import pytest
from scenes import noisy_scan, sorted_corners

from features import ExtractionConfig, Features, LaserScan, extract, sensor_preset
from features.se2 import Array, transform
from sim import World, visible_corners

MODEL = sensor_preset("rplidar-s1")
NEAR = 0.3
"""A corner so near to a place is there [m]."""


def turn_of(beams: int) -> Array:
    return -math.pi + 2.0 * math.pi * np.arange(beams) / beams


def found_in(world: World, pose: Array, rng: np.random.Generator, beams: int = 920) -> Array:
    """Corners of a noisy scan in the frame of the world, shape (k, 2) [m]."""
    scan = noisy_scan(world, pose, rng, MODEL.sigma_range, MODEL.sigma_bearing, turn_of(beams))
    return transform(pose, extract(scan, MODEL).corners.positions)


def box(x: float, y: float, width: float, depth: float) -> list[tuple[float, float]]:
    """Corners of a rectangle from its corner of the least coordinates, counter-clockwise."""
    return [(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)]


def circle(x: float, y: float, radius: float) -> Array:
    angles = turn_of(180)
    return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


def near(corners: Array, place: Array, radius: float = NEAR) -> bool:
    return bool((np.hypot(*(corners - place).T) < radius).any())


@pytest.mark.slow
@pytest.mark.parametrize("beams", [360, 920, 1440])
def test_a_corner_of_two_walls_at_a_right_angle_is_found(beams):
    """Nine of ten where each wall shows 15 beams and half a metre."""
    rng = np.random.default_rng(beams)
    found = []
    for _ in range(250):
        width, depth = rng.uniform(2.0, 12.0, 2)
        world = World.from_polygons("room", [box(0.0, 0.0, width, depth)])
        pose = np.array([rng.uniform(0.5, width - 0.5), rng.uniform(0.5, depth - 0.5), rng.uniform(-math.pi, math.pi)])
        corners = found_in(world, pose, rng, beams)
        visible = visible_corners(world, pose, min_beams=15, min_length=0.5)
        found += [near(corners, corner) for corner in world.corners[visible]]
    assert len(found) > 200
    assert np.mean(found) >= 0.9


@pytest.mark.slow
def test_a_column_has_no_corner():
    rng = np.random.default_rng(1)
    scans, wrong = 400, 0
    for _ in range(scans):
        radius, distance = rng.uniform(0.1, 0.5), rng.uniform(1.0, 5.0)
        world = World.from_polygons("hall", [box(-8.0, -8.0, 16.0, 16.0), circle(distance, 0.0, radius)])
        corners = found_in(world, np.array([0.0, 0.0, rng.uniform(-math.pi, math.pi)]), rng)
        wrong += near(corners, np.array([distance, 0.0]), radius + NEAR)
    assert wrong <= 0.02 * scans


@pytest.mark.slow
def test_a_round_bay_has_no_corner():
    rng = np.random.default_rng(2)
    scans, wrong = 400, 0
    for _ in range(scans):
        radius = rng.uniform(1.0, 3.0)
        pose = np.array([rng.uniform(0.0, 0.6) * radius, 0.0, rng.uniform(-math.pi, math.pi)])
        wrong += len(found_in(World.from_polygons("bay", [circle(0.0, 0.0, radius)]), pose, rng)) > 0
    assert wrong <= 0.02 * scans


def behind_the_side(world: World, pose: Array, side: float, beams: int) -> int:
    """Beams that hit the wall y = 0 beyond the line x = ``side`` of a cupboard's side."""
    ranges, _ = world.cast(pose, turn_of(beams))
    bearings = turn_of(beams) + pose[2]
    hits = pose[:2] + ranges[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    return int(((np.abs(hits[:, 1]) < 1e-6) & (hits[:, 0] > side) & (hits[:, 0] < side + 0.5)).sum())


@pytest.mark.slow
def test_a_cupboard_off_the_wall_makes_no_corner_with_it():
    """15 cm off, where four beams or more pass its side and hit the wall behind it; of two, noise hides one in four."""
    rng = np.random.default_rng(3)
    scans, wrong = 0, 0
    while scans < 300:
        side, depth = rng.uniform(3.0, 5.0), rng.uniform(0.4, 0.8)
        world = World.from_polygons("room", [box(0.0, 0.0, 8.0, 6.0), box(side, 0.15, 1.2, depth)])
        pose = np.array([rng.uniform(0.5, side - 0.5), rng.uniform(0.6, 5.0), rng.uniform(-math.pi, math.pi)])
        if behind_the_side(world, pose, side, 920) < 4:
            continue
        scans += 1
        wrong += near(found_in(world, pose, rng), np.array([side, 0.0]), 0.1)
    assert wrong <= 0.01 * scans


@pytest.mark.slow
def test_a_slender_pillar_in_front_of_a_wall_makes_no_corner_at_it():
    rng = np.random.default_rng(4)
    scans, wrong = 300, 0
    for _ in range(scans):
        width, off = rng.uniform(0.05, 0.15), rng.uniform(0.3, 2.0)
        world = World.from_polygons("room", [box(0.0, 0.0, 8.0, 6.0), box(4.0, off, width, width)])
        pose = np.array([rng.uniform(3.0, 5.0), off + rng.uniform(0.5, 2.5), rng.uniform(-math.pi, math.pi)])
        corners = found_in(world, pose, rng)
        wrong += bool(((corners[:, 1] < 0.15) & (corners[:, 0] > 1.0) & (corners[:, 0] < 7.0)).any())
    assert wrong <= 0.01 * scans


def assert_same_corners(found: Features, expected: Features):
    assert len(found.corners) == len(expected.corners)
    for got, want in zip(sorted_corners(found.corners), sorted_corners(expected.corners), strict=True):
        np.testing.assert_allclose(got, want, atol=1e-9)


def closed_room(rng: np.random.Generator, beams: int) -> LaserScan:
    """Closed scan of a rectangle, seen from off its middle."""
    width, depth = rng.uniform(1.0, 3.0, 2)
    world = World.from_polygons("room", [box(0.0, 0.0, width, depth)])
    pose = np.array([rng.uniform(0.3, 0.7) * width, rng.uniform(0.3, 0.7) * depth, rng.uniform(-math.pi, math.pi)])
    return noisy_scan(world, pose, rng, MODEL.sigma_range, MODEL.sigma_bearing, turn_of(beams))


@pytest.mark.parametrize("seed", range(5))
def test_a_closed_scan_may_start_at_any_beam_and_run_either_way(seed):
    scan = closed_room(np.random.default_rng(seed), 240)
    expected = extract(scan, MODEL)
    assert len(expected.corners) >= 3
    for start in range(0, 240, 7):
        turned = LaserScan(np.roll(scan.ranges, -start), np.roll(scan.angles, -start) + math.pi)
        back = extract(LaserScan(turned.ranges, turned.angles - math.pi), MODEL)
        assert_same_corners(back, expected)
        assert_same_corners(extract(LaserScan(turned.ranges[::-1], turned.angles[::-1] - math.pi), MODEL), expected)


@pytest.mark.parametrize("beams", [12, 17, 24, 33, 48])
def test_closed_scans_of_few_beams_fit_work_arrays_of_their_own(beams):
    """Of a thread that has seen no larger scan; whatever beam is the farthest, the first wall follows the last one."""
    config = ExtractionConfig(
        fit="total-least-squares", min_points=2, trim_points=1, trim_sigmas=0.0, jump_angle_deg=0.5, min_length_m=0.05
    )
    for seed in range(20):
        scan = closed_room(np.random.default_rng(seed), beams)
        for start in range(0, beams, 5):
            turned = LaserScan(np.roll(scan.ranges, -start), scan.angles)
            with ThreadPoolExecutor(1) as thread:
                found = thread.submit(extract, turned, MODEL, config).result()
            lines, corners = extraction_twin.extract(turned.ranges, turned.angles, MODEL, config)
            assert [line.beams for line in lines] == [tuple(pair) for pair in found.lines.beams.tolist()]
            positions = np.array([corner.position for corner in corners]).reshape(-1, 2)
            np.testing.assert_allclose(found.corners.positions, positions, atol=1e-6)
