"""Which beams would have gone through walls, against walls and beams that are crossed one by one."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from registration_scenes import SENSOR, map_of, seen
from shapely import LineString

from features.se2 import compose, transform
from features.sensor import Mounting
from sim.worlds.built_in.demo_room import room
from slam.odometry.beams import BEFORE, ON, THROUGH, UNKNOWN, beams_through_walls, judge_beams
from slam.odometry.line_map import CENTER, LENGTH, NORMAL_X, NORMAL_Y, WALL_FIELDS, WALL_X, WALL_Y
from slam.odometry.rules import BeamRules
from slam.odometry.scan_points import ScanPoints

BEHIND = BeamRules().behind


def walls_between(ends):
    """Walls of segments, shape (m, 4), with their faces towards the origin."""
    walls = np.ones((len(ends), WALL_FIELDS))
    along = ends[:, 2:] - ends[:, :2]
    walls[:, LENGTH] = np.hypot(*along.T)
    walls[:, CENTER] = 0.0
    walls[:, [WALL_X, WALL_Y]] = 0.5 * (ends[:, 2:] + ends[:, :2])
    normals = np.stack([-along[:, 1], along[:, 0]], axis=-1) / walls[:, [LENGTH]]
    towards = np.sign(-(normals * walls[:, [WALL_X, WALL_Y]]).sum(axis=1))
    walls[:, [NORMAL_X, NORMAL_Y]] = towards[:, None] * normals
    return walls


def scan_of(ranges, bearings, mounting):
    points = np.array([mounting.x, mounting.y]) + ranges[:, None] * np.stack(
        [np.cos(bearings), np.sin(bearings)], axis=-1
    )
    none = np.full(len(ranges), -1)
    sensor = dataclasses.replace(SENSOR, mounting=mounting)
    return ScanPoints(
        points, ranges, bearings, none, np.full((len(ranges), 2), np.nan), np.empty((0, WALL_FIELDS)), sensor
    )


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
def test_beams_through_walls_are_those_that_cross_one_and_end_well_behind_it(seed):
    rng = np.random.default_rng(seed)
    bearings = np.sort(rng.uniform(-np.pi, np.pi, 60))
    ranges = rng.uniform(0.5, 6.0, 60)
    mounting = Mounting(0.1, -0.05)
    scan = scan_of(ranges, bearings, mounting)
    middles = rng.uniform(-4.0, 4.0, (5, 2))
    halves = rng.uniform(-1.0, 1.0, (5, 2))
    ends = np.hstack([middles - halves, middles + halves])
    at = np.array([*rng.uniform(-0.2, 0.2, 2), rng.uniform(-np.pi, np.pi)])
    walls = walls_between(ends)
    origin = transform(at, np.array([[mounting.x, mounting.y]]))[0]
    expected = 0
    for point in transform(at, scan.points):
        before = (point - walls[:, [WALL_X, WALL_Y]]) * walls[:, [NORMAL_X, NORMAL_Y]]
        before = before.sum(axis=1)
        faced = ((origin - walls[:, [WALL_X, WALL_Y]]) * walls[:, [NORMAL_X, NORMAL_Y]]).sum(axis=1) > 0.0
        long = origin + 100.0 * (point - origin)
        met = np.array([LineString([origin, long]).intersects(LineString([end[:2], end[2:]])) for end in ends]) & faced
        expected += (met & (before < -BEHIND)).any() and not (met & (abs(before) < 0.5 * BEHIND)).any()
    assert beams_through_walls(scan, walls, at) == expected


@pytest.mark.parametrize("seed", range(5))
def test_from_where_it_is_no_beam_goes_through_a_wall_but_from_beside_many_do(seed):
    """In the room, from half a metre beside the true pose; its walls are known."""
    rng = np.random.default_rng(seed)
    poses = [np.array([x, 1.5, 0.0]) for x in (1.5, 2.5, 3.5)]
    walls = map_of(room(), poses, rng)
    scan = seen(room(), poses[1], rng)
    assert beams_through_walls(scan, walls, poses[1]) <= 2
    beside = compose(poses[1], np.array([0.0, 0.5, 0.2]))
    assert beams_through_walls(scan, walls, beside) > 20


@pytest.mark.parametrize(
    ("ends_at", "judged"),
    [(2.0, ON), (2.1, ON), (1.9, ON), (2.2, UNKNOWN), (1.8, UNKNOWN), (2.5, THROUGH), (1.5, BEFORE)],
)
def test_a_beam_is_judged_by_where_it_ends(ends_at, judged):
    """A wall across, two metres ahead; nothing is known beside it."""
    scan = scan_of(np.array([ends_at, 1.0]), np.array([0.0, 1.5]), Mounting())
    walls = walls_between(np.array([[2.0, -1.0, 2.0, 1.0]]))
    np.testing.assert_array_equal(judge_beams(scan, walls, np.zeros(3)), [judged, UNKNOWN])


def test_a_beam_on_a_wall_goes_through_none_and_ends_before_none():
    """As seen through a door whose leaf was known closed, and with a cupboard before the wall."""
    scan = scan_of(np.array([2.0]), np.array([0.0]), Mounting())
    walls = walls_between(np.array([[x, -1.0, x, 1.0] for x in (1.0, 2.0, 3.0)]))
    np.testing.assert_array_equal(judge_beams(scan, walls, np.zeros(3)), [ON])
