"""Ray casting against a plain all-pairs solution, against shapely, and in the cases where rounding decides."""

import math
import pickle

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from features.se2 import pose
from sim import World, room
from sim.casting.raycast import cast_beams, cast_scans
from sim.casting.sincos import sincos
from sim.casting.wall_index import WallIndex


def cast(walls, origin, angles):
    """Scan of walls that need not make a world, from a sensor that looks along x."""
    ranges, wall_ids = cast_scans(WallIndex.of(np.array(walls, dtype=np.float64)), pose(*origin)[None], angles)
    return ranges[0], wall_ids[0]


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


def assert_equals_brute_force(world, place, angles):
    """Tolerance 1e-9 m; the share of beams for which the plain solution itself is that good."""
    ranges, wall_ids = world.cast(place, angles)
    expected, candidates, sines = brute_force(world.walls, place[:2], place[2] + angles)
    # Flatter than this the plain solution is wrong by more than 1e-9 m: 1e-15 * 10 m / 1e-5.
    fair = (sines > 1e-5).all(axis=1)
    np.testing.assert_array_equal(wall_ids == -1, np.isinf(ranges))
    np.testing.assert_allclose(ranges[fair], expected[fair], rtol=0.0, atol=1e-9)
    hit = fair & (wall_ids >= 0)
    np.testing.assert_allclose(candidates[hit, wall_ids[hit]], ranges[hit], rtol=0.0, atol=1e-9)
    return fair


def random_world(rng):
    """Up to 60 walls that cross: long ones, or short ones far apart, or chains that share vertices."""
    n, kind = int(rng.integers(1, 61)), rng.integers(3)
    points = rng.uniform(-10.0, 10.0, (n + 1, 2))
    steps = points[1:] if kind == 0 else points[:-1] + rng.normal(0.0, 0.7, (n, 2))
    return World("random", np.hstack([points[:-1], points[1:] if kind == 2 else steps]))


@pytest.mark.slow
def test_equals_brute_force_over_ten_thousand_casts():
    """Scans of 40 beams in any order and beyond one turn, 20 from each of 500 worlds."""
    rng = np.random.default_rng(0)
    fair = []
    for _ in range(500):
        world = random_world(rng)
        for _ in range(20):
            place = rng.uniform([-12.0, -12.0, -4.0], [12.0, 12.0, 4.0])
            fair.append(assert_equals_brute_force(world, place, rng.uniform(-10.0, 10.0, 40)))
    assert len(fair) == 10_000
    assert np.mean(fair) > 0.99


@given(seed=st.integers(0, 2**32 - 1))
@settings(derandomize=True, deadline=None, max_examples=50)
def test_equals_brute_force_in_the_room(seed):
    """Beams of a lidar whose noise disturbs their order, from anywhere in the room."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-np.pi, np.pi, 920, endpoint=False) + math.radians(0.3) * rng.standard_normal(920)
    assert_equals_brute_force(room(), rng.uniform([1.0, 1.0, -3.0], [9.0, 7.0, 3.0]), angles)


def test_equals_brute_force_among_thousands_of_walls():
    """Where the tree is deep and nearly all is hidden; a narrow field of view, too."""
    rng = np.random.default_rng(2)
    starts = rng.uniform(-50.0, 50.0, (3000, 2))
    world = World("field", np.hstack([starts, starts + rng.normal(0.0, 0.8, (3000, 2))]))
    for angles in (np.linspace(-np.pi, np.pi, 920, endpoint=False), np.linspace(0.3, 0.4, 50)):
        for _ in range(5):
            assert_equals_brute_force(world, rng.uniform([-40.0, -40.0, -3.0], [40.0, 40.0, 3.0]), angles)


def test_equals_shapely_in_the_room():
    rng = np.random.default_rng(7)
    world = room()
    walls = shapely.multilinestrings([wall.reshape(2, 2) for wall in world.walls])
    angles = rng.uniform(-np.pi, np.pi, 300)
    origin = np.array([2.2, 1.7])
    ranges, _ = world.cast(pose(*origin), angles)
    ends = origin + 30.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    rays = shapely.linestrings(np.stack([np.broadcast_to(origin, ends.shape), ends], axis=1))
    expected = shapely.distance(shapely.intersection(rays, walls), shapely.Point(origin))
    np.testing.assert_allclose(ranges, expected, rtol=0.0, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
@settings(derandomize=True, deadline=None, max_examples=100)
def test_scan_and_single_beams_are_the_same_to_the_last_bit(seed):
    """Two walks through the tree, one by sectors and one beam by beam, find the same hits."""
    rng = np.random.default_rng(seed)
    world = random_world(rng)
    places, angles = rng.uniform(-12.0, 12.0, (4, 3)), rng.uniform(-4.0, 4.0, 50)
    ranges, wall_ids = world.cast_batch(places, angles)
    single_ranges, single_ids = world.cast_beams(np.repeat(places, 50, axis=0), np.tile(angles, 4))
    np.testing.assert_array_equal(single_ranges, ranges.ravel())
    np.testing.assert_array_equal(single_ids, wall_ids.ravel())


def test_batch_is_the_scans_one_by_one():
    places = np.random.default_rng(1).uniform([1.0, 1.0, -3.0], [9.0, 7.0, 3.0], (7, 3))
    angles = np.linspace(-3.0, 3.0, 100)
    ranges, wall_ids = room().cast_batch(places, angles)
    for k, place in enumerate(places):
        one_ranges, one_ids = room().cast(place, angles)
        np.testing.assert_array_equal(one_ranges, ranges[k])
        np.testing.assert_array_equal(one_ids, wall_ids[k])


def test_angles_are_counted_from_the_heading():
    """Tolerance: a sum of angles is rounded to 9e-16 rad, which moves a hit by far less than 1e-9 m."""
    angles = np.linspace(-3.0, 3.0, 100)
    turned, _ = room().cast(pose(2.2, 1.7, 0.8), angles)
    straight, _ = room().cast(pose(2.2, 1.7), angles + 0.8)
    np.testing.assert_allclose(turned, straight, rtol=0.0, atol=1e-9)


def test_a_world_that_was_sent_elsewhere_casts_the_same():
    world = pickle.loads(pickle.dumps(room()))
    angles = np.linspace(-3.0, 3.0, 100)
    for sent, here in zip(world.cast(pose(2.2, 1.7), angles), room().cast(pose(2.2, 1.7), angles), strict=True):
        np.testing.assert_array_equal(sent, here)


@pytest.mark.parametrize("scale", [1.0, 100.0, 9e5])
def test_cosine_and_sine_are_within_two_units_of_the_last_place(scale):
    angles = np.random.default_rng(0).uniform(-scale, scale, 20_000)
    angles = np.concatenate([angles, np.arange(-40, 41) * np.pi / 4.0, [0.0]])
    cosines, sines = np.empty(angles.size), np.empty(angles.size)
    assert sincos(angles, 0.0, cosines, sines)
    for ours, theirs in ((cosines, np.cos(angles)), (sines, np.sin(angles))):
        assert (abs(ours - theirs) <= 2.0 * np.spacing(abs(theirs)) + 1e-21).all()


def test_of_walls_hit_at_the_same_range_the_first_counts():
    """The same wall three times among others, so that they lie in different leaves."""
    wall, other = [2.0, -1.0, 2.0, 1.0], [5.0, -1.0, 5.0, 1.0]
    walls = [[-5.0, -9.0, -5.0, 9.0], wall, other, other, wall, other, [9.0, -1.0, 9.0, 1.0], other, wall]
    _, wall_ids = cast(walls, np.zeros(2), np.linspace(-0.3, 0.3, 9))
    assert (wall_ids == 1).all()
    _, wall_ids = cast_beams(WallIndex.of(np.array(walls)), np.zeros((9, 3)), np.linspace(-0.3, 0.3, 9))
    assert (wall_ids == 1).all()


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
    angles = np.linspace(-3.0, 3.0, 50)
    alone = np.tile([0.3, distance, 0.0], (50, 1))
    for ranges, wall_ids in (cast(walls, alone[0, :2], angles), cast_beams(WallIndex.of(walls), alone, angles)):
        assert (ranges == 0.0).all()
        assert (wall_ids == 1).all()


def test_sensor_on_a_wall_is_covered_though_it_looks_away():
    ranges, wall_ids = cast([[-1.0, 0.0, 1.0, 0.0]], (0.3, 5e-10), np.linspace(1.0, 2.0, 10))
    assert (ranges == 0.0).all()
    assert (wall_ids == 0).all()


def test_sensor_on_a_vertex_is_covered_by_the_first_of_its_walls():
    world = World.from_polygons("square", [[(0, 0), (4, 0), (4, 4), (0, 4)]])
    for vertex, wall in (((4.0, 0.0), 0), ((0.0, 0.0), 0), ((4.0, 4.0), 1), ((0.0, 4.0), 2)):
        ranges, wall_ids = world.cast(pose(*vertex), np.linspace(-3.0, 3.0, 50))
        assert (ranges == 0.0).all()
        assert (wall_ids == wall).all()
        ranges, wall_ids = world.cast_beams(np.tile(pose(*vertex), (50, 1)), np.linspace(-3.0, 3.0, 50))
        assert (ranges == 0.0).all()
        assert (wall_ids == wall).all()


def test_sensor_inside_a_closed_polygon_sees_it_from_within():
    world = World.from_polygons("boxes", [[(0, 0), (9, 0), (9, 9), (0, 9)], [(4, 4), (5, 4), (5, 5), (4, 5)]])
    ranges, wall_ids = world.cast(pose(4.5, 4.5), np.array([0.0, 0.5, 1.0, 1.5]) * np.pi)
    np.testing.assert_allclose(ranges, 0.5, rtol=0.0, atol=1e-12)
    assert wall_ids.tolist() == [5, 6, 7, 4]


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
    for ranges, wall_ids in (
        cast(np.empty((0, 4)), np.zeros(2), np.zeros(3)),
        cast_beams(WallIndex.of(np.empty((0, 4))), np.zeros((3, 3)), np.zeros(3)),
    ):
        assert np.isinf(ranges).all()
        assert (wall_ids == -1).all()
    assert room().cast(pose(2.0, 2.0), np.empty(0))[0].shape == (0,)
    assert room().cast_batch(np.empty((0, 3)), np.zeros(5))[0].shape == (0, 5)
    assert room().cast_beams(np.empty((0, 3)), np.empty(0))[0].shape == (0,)


@pytest.mark.parametrize(
    ("place", "angles", "message"),
    [
        (np.zeros(2), np.zeros(1), r"poses of shape \(m, 3\)"),
        (np.zeros(3), np.zeros((1, 1)), r"angles of \(k,\), got"),
        (np.array([0.0, np.nan, 0.0]), np.zeros(1), "finite"),
        (np.array([0.0, 0.0, np.nan]), np.zeros(1), "finite"),
        (np.zeros(3), np.array([np.inf]), "finite"),
        (np.zeros(3), np.array([2e6]), "no direction beyond 1e[+]06 rad"),
    ],
)
def test_misuse_is_refused(place, angles, message):
    with pytest.raises(ValueError, match=message):
        room().cast(place, angles)
    if angles.ndim == 1 and place.shape == (3,):
        with pytest.raises(ValueError, match=message):
            room().cast_beams(place[None], angles)


def test_single_beams_need_a_pose_each():
    with pytest.raises(ValueError, match=r"poses of shape \(k, 3\)"):
        room().cast_beams(np.zeros((2, 3)), np.zeros(3))
