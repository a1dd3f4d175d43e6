"""Which sections and corners a pose shows, against plain definitions and in cases that can be counted by hand."""

import math

import numpy as np
import pytest
import shapely

from sim import World, environment_a, random_pose, random_room, room, visible_corners, visible_sections

SQUARE = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]
CENTRE = np.array([2.0, 2.0, 0.0])


def first_hits(world, pose, beams):
    """Wall that each beam hits first, and where, by solving ``origin + t d = a + u e`` for all pairs."""
    angles = pose[2] - math.pi + 2.0 * math.pi * np.arange(beams) / beams
    d = np.column_stack([np.cos(angles), np.sin(angles)])
    a, e = world.walls[:, :2] - pose[:2], world.walls[:, 2:] - world.walls[:, :2]
    denominator = d[:, :1] * e[:, 1] - d[:, 1:] * e[:, 0]
    t = (a[:, 0] * e[:, 1] - a[:, 1] * e[:, 0]) / denominator
    u = (a[:, 0] * d[:, 1:] - a[:, 1] * d[:, :1]) / denominator
    t = np.where((u >= 0.0) & (u <= 1.0) & (t > 0.0), t, np.inf)
    nearest = t.argmin(axis=1)
    return nearest, pose[:2] + t[np.arange(beams), nearest, None] * d, angles


def shows_both_walls(world, corner, hits, min_beams, min_length):
    """Count the beams from the corner on, to either side, until they leave its wall."""
    wall_ids, points, angles, origin = hits
    direction = math.atan2(*(world.corners[corner] - origin)[::-1])
    behind = int(np.argmin((direction - angles) % (2.0 * math.pi)))
    walls = set()
    for start, step in ((behind, -1), (behind + 1, 1)):
        run = [start % len(angles)]
        while wall_ids[(run[-1] + step) % len(angles)] == wall_ids[run[0]]:
            run.append((run[-1] + step) % len(angles))
        if len(run) < min_beams or np.hypot(*(points[run[-1]] - points[run[0]])) < min_length:
            return False
        walls.add(int(wall_ids[run[0]]))
    return walls == set(world.corner_walls[corner].tolist())


@pytest.mark.parametrize(("min_beams", "min_length", "beams"), [(6, 0.3, 920), (6, 0.5, 360)])
def test_corners_equal_the_plain_definition(min_beams, min_length, beams):
    found = 0
    for seed in range(12):
        world = random_room(seed)
        pose = random_pose(world, np.random.default_rng(seed))
        hits = (*first_hits(world, pose, beams), pose[:2])
        expected = {k for k in range(len(world.corners)) if shows_both_walls(world, k, hits, min_beams, min_length)}
        corners = visible_corners(world, pose, min_beams, min_length, beams)
        assert set(corners.tolist()) == expected
        assert len(corners) == len(expected)
        found += len(corners)
    assert found >= 30  # enough for the comparison to mean something


def test_nothing_stands_before_a_visible_corner():
    """Shapely finds no wall across the line of sight to it."""
    for seed in range(12):
        world = random_room(seed)
        pose = random_pose(world, np.random.default_rng(seed))
        walls = shapely.multilinestrings([wall.reshape(2, 2) for wall in world.walls])
        for corner in world.corners[visible_corners(world, pose, 6, 0.3)]:
            short_of_it = pose[:2] + (1.0 - 1e-6) * (corner - pose[:2])
            assert not shapely.LineString([pose[:2], short_of_it]).intersects(walls)


def test_corners_are_in_clockwise_order_from_the_heading():
    world, pose = room(), np.array([2.2, 1.7, 2.5])
    seen = world.corners[visible_corners(world, pose, 6, 0.3)] - pose[:2]
    clockwise = (pose[2] - np.arctan2(seen[:, 1], seen[:, 0])) % (2.0 * math.pi)
    assert len(seen) >= 8
    assert (np.diff(clockwise) > 0.0).all()


def test_heading_does_not_change_what_is_seen():
    """Not even where the first beam of the scan falls upon a wall's middle or near a corner."""
    world = environment_a()
    seen = {
        tuple(sorted(visible_corners(world, np.array([4.4, 3.9, heading]), 8, 0.4).tolist()))
        for heading in np.linspace(-4.0, 4.0, 60)
    }
    assert len(seen) == 1


def test_sections_are_runs_of_beams_on_one_wall():
    for seed in range(6):
        world = random_room(seed)
        pose = random_pose(world, np.random.default_rng(seed))
        wall_ids, points, _ = first_hits(world, pose, 920)
        sections = visible_sections(world, pose)
        ends = zip(sections.first_beams, sections.last_beams, sections.beam_counts, strict=True)
        runs = [np.arange(first, first + count) % 920 for first, _, count in ends]
        np.testing.assert_array_equal([run[-1] for run in runs], sections.last_beams)
        np.testing.assert_array_equal(np.sort(np.concatenate(runs)), np.arange(920))
        for k, run in enumerate(runs):
            assert (wall_ids[run] == sections.wall_ids[k]).all()
            assert wall_ids[run[0] - 1] != wall_ids[run[0]]
            # Rounding of 1e-15 m, enlarged where a beam grazes its wall.
            assert sections.lengths[k] == pytest.approx(np.hypot(*(points[run[-1]] - points[run[0]])), abs=1e-9)


def test_wall_across_the_first_beam_is_one_section():
    """The first beam looks straight behind, at the middle of the west wall."""
    sections = visible_sections(World.from_polygons("square", [SQUARE]), CENTRE, beams=100)
    assert len(sections) == 4
    west = int(np.flatnonzero(sections.wall_ids == 3)[0])
    assert sections.first_beams[west] > sections.last_beams[west]
    assert sections.beam_counts.sum() == 100


def test_pillar_splits_the_wall_behind_it():
    pillar = [(2.8, 1.9), (3.0, 1.9), (3.0, 2.1), (2.8, 2.1)]
    sections = visible_sections(World.from_polygons("square", [SQUARE, pillar]), CENTRE)
    assert (sections.wall_ids == 1).sum() == 2
    assert len(sections) == 4 + 2


def test_limits_count_beams_and_metres():
    sections = visible_sections(World.from_polygons("square", [SQUARE]), CENTRE, beams=100)
    fewest, shortest = sections.beam_counts.min(), sections.lengths.min()
    assert sections.shown(fewest, shortest).all()
    assert not sections.shown(sections.beam_counts.max() + 1, 0.0).any()
    assert not sections.shown(0, sections.lengths.max() + 0.01).any()


@pytest.mark.parametrize("beams", [8, 80, 920])
def test_corner_straight_in_a_beam_is_seen(beams):
    """Beams of every eighth of the turn run into the corners of the square."""
    world = World.from_polygons("square", [SQUARE])
    corners = visible_corners(world, CENTRE, 1, 0.0, beams)
    np.testing.assert_array_equal(world.corners[corners], [(4.0, 0.0), (0.0, 0.0), (0.0, 4.0), (4.0, 4.0)])


def test_edge_of_a_wall_before_its_neighbour_is_no_corner():
    """Two walls meet at the left, yet the scan goes from one to the other at the right, where the near one ends."""
    world = World("wedge", np.array([[0.0, 0.0, 4.0, 0.0], [0.0, 0.0, 8.0, 2.0]]))
    pose = np.array([4.0, -2.0, 0.0])
    sections = visible_sections(world, pose)
    np.testing.assert_array_equal(sections.wall_ids, [1, 0])
    assert sections.first_beams[1] == sections.last_beams[0] + 1
    assert len(visible_corners(world, pose, 2, 0.1)) == 0
    assert len(visible_corners(world, np.array([3.0, 0.3, 0.0]), 2, 0.1)) == 1


def test_beam_that_hits_nothing_is_in_no_section():
    world = World("wall", np.array([[1.0, -1.0, 1.0, 1.0]]))
    sections = visible_sections(world, np.zeros(3), beams=360)
    assert len(sections) == 1
    assert abs(sections.beam_counts[0] - 90) <= 1
    assert len(visible_sections(World("wall", np.array([[-1.0, 2.0, 2.0, -1.0]])), np.array([9.0, 9.0, 0.0]), 3)) == 0


def test_sensor_on_a_wall_sees_that_wall_and_no_length():
    sections = visible_sections(World.from_polygons("square", [SQUARE]), np.array([0.0, 2.0, 0.0]), beams=100)
    np.testing.assert_array_equal(sections.wall_ids, [3])
    np.testing.assert_array_equal(sections.beam_counts, [100])
    np.testing.assert_array_equal(sections.lengths, [0.0])


def test_a_scan_needs_a_beam():
    with pytest.raises(ValueError, match="beams is 0"):
        visible_corners(room(), CENTRE, 1, 0.0, beams=0)


def test_a_field_of_view_cuts_sections_and_does_not_wrap():
    """From the centre of a square, half a turn forward shows one wall whole and two from their middles on."""
    angles = np.radians(np.arange(-89.5, 90.0))
    sections = visible_sections(World.from_polygons("square", [SQUARE]), CENTRE, angles)
    assert sections.wall_ids.tolist() == [0, 1, 2]
    assert sections.beam_counts.tolist() == [45, 90, 45]
    np.testing.assert_allclose(sections.lengths, [2.0, 4.0, 2.0], atol=0.1)
    corners = visible_corners(World.from_polygons("square", [SQUARE]), CENTRE, 15, 0.5, angles)
    assert corners.tolist() == [1, 2]
    assert len(visible_corners(World.from_polygons("square", [SQUARE]), CENTRE, 46, 0.5, angles)) == 0
    nearly_all = visible_sections(World.from_polygons("square", [SQUARE]), CENTRE, np.radians(np.arange(-170.5, 171.0)))
    assert nearly_all.wall_ids.tolist() == [3, 0, 1, 2, 3]
    assert nearly_all.beam_counts.tolist() == [36, 90, 90, 90, 36]


def test_beams_over_the_full_turn_are_the_same_by_number_and_by_direction():
    world, angles = room(), -np.pi + 2.0 * np.pi * np.arange(500) / 500
    place = np.array([2.5, 2.0, 0.3])
    np.testing.assert_array_equal(
        visible_corners(world, place, 5, 0.2, angles), visible_corners(world, place, 5, 0.2, 500)
    )
