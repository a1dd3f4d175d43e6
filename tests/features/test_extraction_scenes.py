"""What counts as a corner, on scenes without noise whose corners are known."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import law
from scenes import FULL_TURN, HALF_TURN, corners_in_sensor_frame, exact_scan, polygon, square

from features import ExtractionConfig, LaserScan, extract, sensor_preset
from features.fitting.corner import intersect
from features.fitting.line_fit import fit_cwlf
from sim import ENVIRONMENT_A_POSE, Lidar, World, environment_a, room

MODEL = sensor_preset("rplidar-s1")
EXACT = 1e-9
"""Points without noise, trimmed of those near the corner, lie on their wall to rounding; so does the corner."""


def wedge(opening, orientation, apex, length=3.0):
    """Two walls that meet in the apex, the bisector between them pointing along ``orientation``."""
    arms = orientation + np.array([-0.5, 0.5]) * opening
    ends = np.asarray(apex) + length * np.column_stack([np.cos(arms), np.sin(arms)])
    return World("wedge", np.array([[*apex, *end] for end in ends]))


def assert_nearest(positions, expected):
    """Each position is one of the expected ones and each of these is met once."""
    distances = np.hypot(*np.moveaxis(positions[:, None] - expected, 2, 0))
    assert sorted(distances.argmin(axis=1)) == list(range(len(expected)))
    assert distances.min(axis=1).max() < EXACT


@law
@given(st.floats(-math.pi, math.pi), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_closed_contour_without_any_jump_shows_all_its_corners(turn, x, y):
    world = square(turn=turn, shift=(x, y))
    corners = extract(exact_scan(world), MODEL).corners
    assert_nearest(corners.positions, world.corners)
    np.testing.assert_allclose(corners.opening_angles, math.pi / 2.0, atol=EXACT)
    assert not corners.convex.any()
    inward = np.array([x, y]) - corners.positions
    np.testing.assert_allclose(np.cos(corners.orientations - np.arctan2(inward[:, 1], inward[:, 0])), 1.0, atol=EXACT)


@law
@given(st.floats(-math.pi, math.pi))
def test_an_l_shaped_room_has_five_concave_corners_and_a_convex_one(turn):
    world = polygon([(-1.5, -1.5), (3.0, -1.5), (3.0, 1.0), (1.0, 1.0), (1.0, 3.0), (-1.5, 3.0)], turn)
    corners = extract(exact_scan(world), MODEL).corners
    assert_nearest(corners.positions, world.corners)
    assert corners.convex.sum() == 1
    assert np.hypot(*corners.positions[corners.convex][0]) == pytest.approx(math.sqrt(2.0))


@law
@given(st.floats(-math.pi, math.pi), st.floats(1.5, 2.5))
def test_a_pillar_shows_a_convex_corner(direction, distance):
    """Seen edge on, 50 cm wide: the near corner points at the sensor and the pillar lies behind it."""
    apex = distance * np.array([math.cos(direction), math.sin(direction)])
    along = direction + np.array([-0.25, 0.0, 0.25]) * math.pi
    reach = np.array([0.5, 0.5 * math.sqrt(2.0), 0.5])
    others = apex + reach[:, None] * np.column_stack([np.cos(along), np.sin(along)])
    corners = extract(exact_scan(World.from_polygons("pillar", [[apex, *others]])), MODEL).corners
    assert_nearest(corners.positions, apex[None])
    assert corners.convex.all()
    assert math.cos(corners.orientations[0] - direction) == pytest.approx(1.0, abs=EXACT)


@law
@given(st.floats(35.0, 145.0), st.floats(-math.pi, math.pi), st.booleans())
def test_a_wedge_has_its_opening_angle_orientation_and_kind(opening_deg, orientation, convex):
    """Seen from inside, 2.5 m from the apex, or from outside."""
    opening = math.radians(opening_deg)
    bisector = np.array([math.cos(orientation), math.sin(orientation)])
    apex = 2.5 * bisector if convex else -2.5 * bisector
    corners = extract(exact_scan(wedge(opening, orientation, apex)), MODEL).corners
    assert_nearest(corners.positions, apex[None])
    assert corners.opening_angles[0] == pytest.approx(opening, abs=EXACT)
    assert math.cos(corners.orientations[0] - orientation) == pytest.approx(1.0, abs=EXACT)
    assert corners.convex[0] == convex


@pytest.mark.parametrize("first", [-math.pi, 0.0, 1.0, -5.0])
@pytest.mark.parametrize("clockwise", [False, True])
def test_a_corner_where_the_scan_starts_and_ends_is_found(first, clockwise):
    """Straight behind the sensor for a scan from -pi to pi; and the walls there run across the end of the scan."""
    angles = first + (2.0 * math.pi / 920.0) * np.arange(920) * (-1.0 if clockwise else 1.0)
    world = square(turn=first + math.pi / 4.0)
    features = extract(exact_scan(world, angles), MODEL)
    assert_nearest(features.corners.positions, world.corners)


def test_a_corner_across_the_end_of_the_scan_is_found_where_there_are_jumps():
    """The contour is open: a wedge behind the sensor, nothing else."""
    world = wedge(math.pi / 2.0, 0.0, (-2.0, 0.0))
    features = extract(exact_scan(world), MODEL)
    assert_nearest(features.corners.positions, world.corners)
    assert len(features.lines) == 2


def test_a_wall_across_the_end_of_the_scan_is_one_line():
    features = extract(exact_scan(World("wall", np.array([[-2.0, -1.5, -2.0, 1.5]]))), MODEL)
    assert len(features.lines) == 1
    first, last = features.lines.beams[0]
    assert first > last


def test_half_a_turn_is_not_closed_across_its_end():
    """A square room, seen ahead only: the walls at both ends of the scan are cut off, not joined."""
    world = square(turn=0.3)
    features = extract(exact_scan(world, HALF_TURN), MODEL)
    assert_nearest(features.corners.positions, world.corners[world.corners[:, 0] > 0.0])
    assert len(features.lines) == 3


def test_a_wall_parallel_to_the_chord_of_its_cluster_keeps_both_corners():
    world = square()
    corners = extract(exact_scan(world, HALF_TURN), MODEL).corners
    assert_nearest(corners.positions, world.corners[world.corners[:, 0] > 0.0])


def test_an_occlusion_edge_is_no_corner():
    """A wall in front of another hides a part of it: on neither side of the edge do walls meet."""
    world = World("edge", np.array([[2.0, -2.0, 2.0, 0.0], [5.0, -4.0, 5.0, 4.0]]))
    features = extract(exact_scan(world), MODEL)
    assert len(features.lines) == 2
    assert len(features.corners) == 0


def test_walls_that_would_meet_behind_an_occlusion_edge_are_no_corner():
    """The near wall's extension hits the far one just where it comes into sight."""
    world = World("edge", np.array([[1.5, -1.0, 2.0, 0.0], [2.6, 1.2, 4.0, 0.1], [2.5, 1.0, 2.5, 4.0]]))
    features = extract(exact_scan(world), MODEL)
    assert len(features.lines) >= 2
    assert len(features.corners) == 0


@pytest.mark.parametrize("end", [3.0, 4.0, 5.5])
@pytest.mark.parametrize("offset", [0.15, 0.2, 0.25])
def test_walls_between_which_a_short_one_stands_are_no_corner(offset, end):
    """A corridor with a shallow niche in its end: its side and the back of the niche would meet within the gap."""
    side, inner = 0.65, 0.65 - offset
    path = [(0.5, side), (end, side), (end, inner), (end + offset, inner), (end + offset, -inner)]
    world = World("niche", np.array([[*a, *b] for a, b in itertools.pairwise(path)]))
    corners = extract(exact_scan(world), MODEL).corners
    assert (np.linalg.norm(corners.positions - [end + offset, side], axis=1) > 0.05).all()


def test_a_gap_where_walls_would_meet_is_no_corner():
    """A doorway of 40 cm on either side of where the walls would meet."""
    world = World("doorway", np.array([[2.0, -2.0, 2.0, 1.6], [1.6, 2.0, -2.0, 2.0]]))
    features = extract(exact_scan(world), MODEL)
    assert len(features.lines) == 2
    assert len(features.corners) == 0


def test_beams_without_return_where_walls_meet_are_a_gap():
    """More than gap_beams = 3.5 beam spacings: four missing beams are five spacings."""
    scan = exact_scan(square(turn=math.pi / 4.0))
    ranges = scan.ranges.copy()
    ahead = np.abs(scan.angles) < 2.0 * math.pi / 920.0 * 2.5
    ranges[ahead] = np.inf
    corners = extract(LaserScan(ranges, scan.angles), MODEL).corners
    assert len(corners) == 3
    assert np.hypot(*(corners.positions - [2.0 * math.sqrt(2.0), 0.0]).T).min() > 1.0


@pytest.mark.parametrize(("bend_deg", "count"), [(20.0, 0), (28.0, 0), (35.0, 1), (60.0, 1)])
def test_walls_that_are_nearly_one_are_no_corner(bend_deg, count):
    """Both are lines; the bluntest corner is 150 deg, a bend of 30."""
    features = extract(exact_scan(wedge(math.radians(180.0 - bend_deg), math.pi, (2.0, 0.0))), MODEL)
    assert len(features.lines) == 2
    assert len(features.corners) == count


@pytest.mark.parametrize(("opening_deg", "count"), [(20.0, 0), (28.0, 0), (32.0, 1)])
def test_a_slit_sharper_than_the_sharpest_corner_is_none(opening_deg, count):
    corners = extract(exact_scan(wedge(math.radians(opening_deg), math.pi, (2.5, 0.0))), MODEL).corners
    assert len(corners) == count


@pytest.mark.parametrize("pose", [(2.2, 1.7, 0.0), (7.4, 1.8, 2.0), (6.2, 6.3, -1.0), (1.6, 4.0, 0.5)])
def test_in_the_room_every_corner_that_is_found_is_there(pose):
    """Walls end in corners, pillars are convex; a point of the neighbour wall may stay below the split distance."""
    world = room()
    found = extract(exact_scan(world, pose=pose), MODEL).corners
    expected = corners_in_sensor_frame(world, np.array(pose))
    distances = np.hypot(*np.moveaxis(found.positions[:, None] - expected, 2, 0))
    assert len(found) >= 5
    assert distances.min(axis=1).max() < 1e-3
    nearest = distances.argmin(axis=1)
    assert len(set(nearest)) == len(nearest)
    np.testing.assert_allclose(found.opening_angles, world.opening_angles[nearest], atol=1e-3)
    free_standing = nearest >= len(expected) - 12
    assert found.convex[free_standing].all()


@pytest.mark.parametrize("no_return", [np.inf, 0.0, 0.05, 40.5, 1e9])
def test_a_beam_outside_the_range_limits_is_skipped(no_return):
    """Every value that means no return gives the same features as any other, and no corner moves."""
    scan = exact_scan(square(turn=0.2))
    missing = np.random.default_rng(0).uniform(size=len(scan)) < 0.03
    features = extract(LaserScan(np.where(missing, no_return, scan.ranges), scan.angles), MODEL)
    reference = extract(LaserScan(np.where(missing, np.inf, scan.ranges), scan.angles), MODEL)
    np.testing.assert_array_equal(features.lines.params, reference.lines.params)
    np.testing.assert_array_equal(features.corners.covs, reference.corners.covs)
    assert_nearest(features.corners.positions, square(turn=0.2).corners)


@pytest.mark.parametrize(("trim", "count"), [(0, 5), (1, 7)])
def test_a_wall_alone_is_a_line_from_the_least_number_of_points_on_that_trimming_leaves(trim, count):
    config = ExtractionConfig(min_points=5, trim_points=trim, trim_sigmas=0.0)
    for points, lines in ((count - 1, 0), (count, 1)):
        angles = np.radians(5.0) * (np.arange(points) - 0.5 * (points - 1))
        scan = LaserScan(ranges=2.0 / np.cos(angles), angles=angles)
        assert len(extract(scan, MODEL, config).lines) == lines


@pytest.mark.parametrize("beams", [0, 1, 4])
def test_a_scan_of_a_few_beams_shows_nothing(beams):
    features = extract(LaserScan(np.full(beams, 2.0), FULL_TURN[:beams]), MODEL)
    assert (len(features.lines), len(features.corners)) == (0, 0)
    assert features.lines.ends.shape == (0, 2, 2)
    assert features.corners.covs.shape == (0, 2, 2)


@pytest.mark.parametrize("no_return", [np.inf, 0.0, 100.0])
def test_a_scan_without_any_return_shows_nothing(no_return):
    features = extract(LaserScan(np.full(920, no_return), FULL_TURN), MODEL)
    assert (len(features.lines), len(features.corners)) == (0, 0)


def test_lines_name_their_beams():
    """First and last beam of each line, counter-clockwise, and as many points as lie between them."""
    scan = exact_scan(square(turn=0.3), FULL_TURN)
    lines = extract(scan, MODEL).lines
    assert len(lines) == 4
    for line, (first, last) in zip(lines, lines.beams, strict=True):
        assert line.count == (last - first) % len(scan) + 1
        for point, beam in ((line.start, first), (line.end, last)):
            direction = np.array([math.cos(scan.angles[beam]), math.sin(scan.angles[beam])])
            np.testing.assert_allclose(point, scan.ranges[beam] * direction, atol=EXACT)


def test_a_turn_whose_last_beam_repeats_the_first_has_no_gap():
    angles = np.linspace(0.0, 2.0 * math.pi, 921)
    world = square(turn=math.pi / 4.0)
    assert_nearest(extract(exact_scan(world, angles), MODEL).corners.positions, world.corners)


def test_the_gap_rule_does_not_depend_on_where_angles_are_wrapped():
    """Half a turn that looks backwards, its angles wrapped to -pi..pi: three beams are missing in the corner."""
    angles = np.radians(np.arange(-90.0, 90.0))
    ranges, _ = square(turn=math.pi / 4.0, half=math.sqrt(2.0)).cast(np.zeros(3), angles)
    ranges[88:91] = np.inf
    backwards = angles + math.pi
    plain = extract(LaserScan(ranges, backwards), MODEL)
    wrapped = extract(LaserScan(ranges, (backwards + math.pi) % (2.0 * math.pi) - math.pi), MODEL)
    assert len(wrapped.corners) == len(plain.corners)


def test_a_range_of_zero_is_no_return_for_a_sensor_without_a_shortest_range():
    scan = exact_scan(square())
    ranges = scan.ranges.copy()
    ranges[5:9] = [0.02, 0.0, 0.03, 0.02]
    features = extract(LaserScan(ranges, scan.angles), dataclasses.replace(MODEL, range_min=0.0))
    assert len(features.corners) >= 3


@pytest.mark.parametrize("seed", range(3))
def test_the_preset_of_the_paper_fits_all_points_of_each_segment_and_intersects_neighbours(seed):
    """Eq. 20-35 with eq. 31-32 on the beams of each line, and eq. 40-48 on each two neighbours."""
    model = sensor_preset("rplidar-s1")
    scan = Lidar.of_preset("rplidar-s1").scan(environment_a(), ENVIRONMENT_A_POSE, 0.0, np.random.default_rng(seed))
    found = extract(scan, model, ExtractionConfig(preset="paper"))
    assert len(found.corners) >= 4
    lines = list(found.lines)
    for line, (first, last) in zip(lines, found.lines.beams, strict=True):
        beams = np.arange(first, last + 1 if last >= first else last + 1 + len(scan)) % len(scan)
        beams = beams[model.returned(scan.ranges[beams])]
        expected = fit_cwlf(scan.ranges[beams], scan.angles[beams], model, "paper")
        assert line.count == len(beams)
        np.testing.assert_allclose(line.params, expected.params, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(line.cov, expected.cov, rtol=1e-7, atol=1e-15)
    crossings = [intersect(a, b) for a, b in zip(lines, [*lines[1:], lines[0]], strict=True)]
    for corner in found.corners:
        apart = [
            np.abs(corner.position - position).max() + np.abs(corner.cov - cov).max() for position, cov in crossings
        ]
        assert min(apart) < 1e-9
