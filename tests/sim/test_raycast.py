"""Ray casting against a plain all-pairs solution, against shapely, and in the cases where rounding decides."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from sim import World, cast, room


def brute_force(walls, origin, angles):
    """Solve ``origin + t d = a + u e`` for every beam and wall.

    Returns ranges (k,), every t (k, n) and the sine of every angle between beam and wall (k, n).
    """
    d = np.column_stack([np.cos(angles), np.sin(angles)])[:, None, :]
    a, e = walls[:, :2] - origin, walls[:, 2:] - walls[:, :2]
    denominator = d[..., 0] * e[:, 1] - d[..., 1] * e[:, 0]
    t = (a[:, 0] * e[:, 1] - a[:, 1] * e[:, 0]) / denominator
    u = (a[:, 0] * d[..., 1] - a[:, 1] * d[..., 0]) / denominator
    t = np.where((u >= 0.0) & (u <= 1.0) & (t > 0.0), t, np.inf)
    return t.min(axis=1), t, abs(denominator) / np.hypot(*e.T)


def assert_equals_brute_force(walls, origin, angles):
    ranges, wall_ids = cast(walls, origin, angles)
    expected, candidates, sines = brute_force(walls, origin, angles)
    # Flatter than this the plain solution itself is wrong by more than 1e-9 m: 1e-15 * 10 m / 1e-5.
    fair = (sines > 1e-5).all(axis=1)
    np.testing.assert_array_equal(wall_ids == -1, np.isinf(ranges))
    np.testing.assert_allclose(ranges[fair], expected[fair], rtol=0.0, atol=1e-9)
    hit = fair & (wall_ids >= 0)
    np.testing.assert_allclose(candidates[hit, wall_ids[hit]], ranges[hit], rtol=0.0, atol=1e-9)
    return fair


@given(seed=st.integers(0, 2**32 - 1), n_walls=st.integers(1, 40))
@settings(derandomize=True, deadline=None, max_examples=150)
def test_equals_brute_force_on_random_walls(seed, n_walls):
    """Walls that cross each other, and beams in any order and beyond one turn."""
    rng = np.random.default_rng(seed)
    walls = rng.uniform(-10.0, 10.0, (n_walls, 4))
    fair = assert_equals_brute_force(walls, rng.uniform(-5.0, 5.0, 2), rng.uniform(-10.0, 10.0, 300))
    assert fair.mean() > 0.9


@given(seed=st.integers(0, 2**32 - 1))
@settings(derandomize=True, deadline=None, max_examples=50)
def test_equals_brute_force_in_the_room(seed):
    """Beams of a lidar whose noise disturbs their order, from anywhere in the room."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-np.pi, np.pi, 920, endpoint=False) + math.radians(0.3) * rng.standard_normal(920)
    assert_equals_brute_force(room().walls, rng.uniform([1.0, 1.0], [9.0, 7.0]), angles)


def test_equals_shapely_in_the_room():
    rng = np.random.default_rng(7)
    world = room()
    walls = shapely.multilinestrings([wall.reshape(2, 2) for wall in world.walls])
    angles = rng.uniform(-np.pi, np.pi, 300)
    origin = np.array([2.2, 1.7])
    ranges, _ = cast(world.walls, origin, angles)
    ends = origin + 30.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    rays = shapely.linestrings(np.stack([np.broadcast_to(origin, ends.shape), ends], axis=1))
    expected = shapely.distance(shapely.intersection(rays, walls), shapely.Point(origin))
    np.testing.assert_allclose(ranges, expected, rtol=0.0, atol=1e-9)


def test_order_of_beams_does_not_matter():
    rng = np.random.default_rng(3)
    angles = rng.uniform(-np.pi, np.pi, 500)
    origin = np.array([2.2, 1.7])
    ranges, wall_ids = cast(room().walls, origin, angles)
    order = rng.permutation(500)
    shuffled, shuffled_ids = cast(room().walls, origin, angles[order])
    np.testing.assert_array_equal(shuffled, ranges[order])
    np.testing.assert_array_equal(shuffled_ids, wall_ids[order])


def test_whole_turns_do_not_matter():
    """Tolerance: 20 pi is rounded to 7e-15 rad, which moves the hit of a flat beam by far less than 1e-9 m."""
    angles = np.linspace(-3.1, 3.1, 101)
    origin = np.array([2.2, 1.7])
    expected, _ = cast(room().walls, origin, angles)
    for turns in (-10, -1, 1, 10):
        ranges, _ = cast(room().walls, origin, angles + 2.0 * np.pi * turns)
        np.testing.assert_allclose(ranges, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("origin", [(2.2, 1.7), (5.0, 2.0), (8.1, 3.6), (1.0, 7.5)])
def test_closed_outline_has_no_gap_at_its_vertices(origin):
    """Beams at each vertex, and at its neighbours one rounding step away, hit it or what is behind it."""
    world = room()
    origin = np.array(origin)
    to_corner = world.corners - origin
    angles = np.arctan2(to_corner[:, 1], to_corner[:, 0])
    for beams in (angles, np.nextafter(angles, 10.0), np.nextafter(angles, -10.0)):
        ranges, wall_ids = cast(world.walls, origin, beams)
        assert np.isfinite(ranges).all()
        assert (wall_ids >= 0).all()


def test_concave_vertex_is_hit_at_its_distance():
    world = World.from_polygons("hexagon", [[(2, 0), (1, 2), (-1, 2), (-2, 0), (-1, -2), (1, -2)]])
    ranges, _ = cast(world.walls, np.zeros(2), np.arctan2(world.corners[:, 1], world.corners[:, 0]))
    np.testing.assert_allclose(ranges, np.hypot(*world.corners.T), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("wall", [(2, 0, 2, 1), (2, 1, 2, 0), (2, 0, 2, -1), (2, 0, 3, 1)])
def test_beam_through_the_end_of_a_wall_hits_it(wall):
    ranges, wall_ids = cast(np.array([wall]), np.zeros(2), np.array([0.0]))
    assert ranges.tolist() == [2.0]
    assert wall_ids.tolist() == [0]


@pytest.mark.parametrize("wall", [(2, 0, 5, 0), (5, 0, 2, 0)])
def test_beam_along_a_wall_hits_its_nearer_end(wall):
    ranges, _ = cast(np.array([wall]), np.zeros(2), np.array([0.0, 0.1, 3.0]))
    assert ranges.tolist() == [2.0, math.inf, math.inf]


def test_nearly_parallel_beam_hits_a_point_of_the_wall():
    """Where the hit is ill-conditioned, its range still lies between those of the wall's ends."""
    walls = np.array([[2.0, 0.0, 5.0, 3e-16]])
    ranges, _ = cast(walls, np.zeros(2), np.array([0.0, 2e-17, 4e-17, 6e-17]))
    assert ((ranges >= 2.0) & (ranges <= 5.0)).all()


@pytest.mark.parametrize("distance", [0.0, 5e-10, -5e-10])
def test_sensor_on_a_wall_is_covered(distance):
    walls = np.array([[5.0, -1.0, 5.0, 1.0], [-1.0, 0.0, 1.0, 0.0]])
    ranges, wall_ids = cast(walls, np.array([0.3, distance]), np.linspace(-3.0, 3.0, 50))
    assert (ranges == 0.0).all()
    assert (wall_ids == 1).all()


@pytest.mark.parametrize("distance", [1e-8, -1e-8])
def test_sensor_just_beside_a_wall_is_not_covered(distance):
    """It sees the wall over half a turn and the open on the other side."""
    walls = np.array([[-1.0, 0.0, 1.0, 0.0]])
    angles = np.linspace(0.1, np.pi - 0.1, 20)
    ranges, _ = cast(walls, np.array([0.3, distance]), np.concatenate([angles, -angles]))
    expected = np.where(np.arange(40) < 20, -distance, distance)
    expected = np.where(expected > 0.0, abs(distance) / np.sin(np.tile(angles, 2)), np.inf)
    np.testing.assert_allclose(ranges, expected, rtol=0.0, atol=1e-15)


def test_wall_across_the_cut_at_half_a_turn_is_hit():
    """A wall behind the sensor spans headings on both sides of +-pi."""
    angles = np.array([np.pi - 0.2, -np.pi + 0.2, np.pi, -np.pi, np.pi + 0.2, 0.0])
    ranges, _ = cast(np.array([[-2.0, -1.0, -2.0, 1.0]]), np.zeros(2), angles)
    slant = 2.0 / math.cos(0.2)
    np.testing.assert_allclose(ranges, [slant, slant, 2.0, 2.0, slant, np.inf], rtol=0.0, atol=1e-12)


def test_no_wall_and_no_beam_are_allowed():
    ranges, wall_ids = cast(np.empty((0, 4)), np.zeros(2), np.zeros(3))
    assert np.isinf(ranges).all()
    assert (wall_ids == -1).all()
    assert cast(room().walls, np.array([2.0, 2.0]), np.empty(0))[0].shape == (0,)


@pytest.mark.parametrize(
    ("walls", "origin", "angles", "message"),
    [
        (np.zeros((2, 3)), np.zeros(2), np.zeros(1), "expected walls"),
        (np.zeros((2, 4)), np.zeros(3), np.zeros(1), "expected"),
        (np.zeros((2, 4)), np.zeros(2), np.zeros((1, 1)), "expected walls"),
        (np.zeros((2, 4)), np.array([0.0, np.nan]), np.zeros(1), "finite"),
        (np.zeros((2, 4)), np.zeros(2), np.array([np.inf]), "finite"),
    ],
)
def test_misuse_is_refused(walls, origin, angles, message):
    with pytest.raises(ValueError, match=message):
        cast(walls, origin, angles)
