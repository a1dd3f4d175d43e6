"""The life of landmarks in the local filter: birth, rest and wake, merging, and what the beams go through."""

import math

import numpy as np
import pytest
from finite_difference import finite_difference
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from observed_corners import corners
from scipy.linalg import block_diag

from features.scan import LaserScan
from features.se2 import between, compose, pose, rotation, transform, wrap_angle
from features.sensor import Mounting, SensorModel
from slam.filter.association import Gates
from slam.filter.ekf import predict_corners
from slam.filter.front_end import FrontEnd
from slam.filter.landmark_table import ACTIVE, MERGED, REMOVED
from slam.filter.rules import FilterRules
from slam.odometry.beams import HIDDEN, IN_SIGHT, PASSED, look_at
from slam.odometry.rules import BeamRules

KEEP = 5.0
BEHIND = BeamRules().behind
seeds = st.integers(0, 10_000)
headings = st.one_of(st.floats(-math.pi, math.pi), st.sampled_from([math.pi, -math.pi]))
NOWHERE = np.zeros((3, 3))

# The first association loads compiled code.
unhurried = settings(deadline=None)

NOTHING = np.empty(0, np.int64)


def front_end(first=pose(), cov=1e-6 * np.eye(3), birth_distance=0.5, rules=FilterRules()):  # noqa: B008, not written to
    gates = Gates("joint", 0.99, 0.9999, birth_distance, math.radians(20.0), math.radians(30.0))
    return FrontEnd(first, cov, gates, KEEP, rules=rules)


def resting(seed, heading):
    """A front end that laid the far ones of its landmarks to rest in key frame 0 and drove on; that frame's pose."""
    rng = np.random.default_rng(seed)
    front = front_end(pose(*rng.normal(0.0, 5.0, 2), heading), np.diag([0.1, 0.1, 0.05]) ** 2)
    front.observe(corners([[2.0, 1.0], [5.5, 0.5], [6.0, -1.0], [1.0, -2.0]], orientations=0.4, sigma=(0.02, 0.08)))
    key_pose = front.ekf.pose
    front.deactivate_far(0, NOTHING)
    front.move(pose(*rng.normal([3.0, 0.0, 0.3], 0.2)), np.diag([0.05, 0.05, 0.02]) ** 2)
    return front, key_pose, rng


@unhurried
@given(seeds, headings)
def test_rest_keeps_a_landmark_as_its_key_frame_sees_it(seed, heading):
    rng = np.random.default_rng(seed)
    front = front_end(pose(*rng.normal(0.0, 5.0, 2), heading), np.diag([0.1, 0.1, 0.05]) ** 2)
    positions = [[2.0, 1.0], [5.5, 0.5], [6.0, -1.0], [1.0, -2.0]]
    front.observe(corners(positions))
    x, P = front.ekf.x.copy(), front.ekf.P.copy()
    front.deactivate_far(3, NOTHING)
    assert front.active.tolist() == [0, 3]
    assert front.table.key_frames.tolist() == [ACTIVE, 3, 3, ACTIVE]
    np.testing.assert_allclose(front.table.positions[[1, 2]], np.array(positions)[[1, 2]], atol=1e-9)
    # Seen once and from here: as uncertain as the corner, however uncertain the pose.
    np.testing.assert_allclose(front.table.covs[[1, 2]], np.tile(0.05**2 * np.eye(2), (2, 1, 1)), atol=1e-12)
    kept = np.r_[0:5, 9:11]
    np.testing.assert_array_equal(front.ekf.x, x[kept])
    np.testing.assert_array_equal(front.ekf.P, P[np.ix_(kept, kept)])


@unhurried
@given(seeds, headings)
def test_a_landmark_wakes_where_it_was_when_its_key_frame_did_not_move(seed, heading):
    front, key_pose, _ = resting(seed, heading)
    known = transform(key_pose, np.array([[5.5, 0.5], [6.0, -1.0]]))
    front.reactivate(np.array([key_pose, front.ekf.pose]), np.array([0]), NOWHERE)
    assert front.active.tolist() == [0, 3, 1, 2]
    np.testing.assert_allclose(front.ekf.landmarks[2:], known, rtol=0, atol=1e-9)
    np.testing.assert_allclose(wrap_angle(front.table.signatures().orientations - 0.4 - key_pose[2]), 0.0, atol=1e-9)
    assert (front.table.key_frames == ACTIVE).all()
    assert np.linalg.eigvalsh(front.ekf.P).min() > 0.0


@unhurried
@given(seeds, headings)
def test_a_landmark_wakes_where_its_key_frame_has_moved_to(seed, heading):
    front, _, rng = resting(seed, heading)
    here = front.ekf.pose
    moved = compose(here, pose(*rng.normal([-4.0, 0.0, 0.0], 0.1)))
    front.reactivate(np.array([moved, here]), np.array([0]), NOWHERE)
    np.testing.assert_allclose(
        front.ekf.landmarks[2:], transform(moved, np.array([[5.5, 0.5], [6.0, -1.0]])), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        wrap_angle(front.table.signatures().orientations[[1, 2]] - 0.4 - moved[2]), 0.0, atol=1e-9
    )


@unhurried
@given(seeds, headings)
def test_a_woken_landmark_is_as_uncertain_as_its_rest_and_the_way_to_its_key_frame(seed, heading):
    """Against a numeric Jacobian: the landmark in the robot frame, by the place at rest and by the pose here."""
    front, key_pose, rng = resting(seed, heading)
    here = front.ekf.pose
    root = rng.normal(0.0, 0.05, (3, 3))
    passage_cov = root @ root.T
    at_rest = front.table.positions[[1, 2]].ravel()
    rest_cov = block_diag(*front.table.covs[[1, 2]])

    def seen(both):
        world = transform(key_pose, both[3:].reshape(-1, 2))
        return ((world - both[:2]) @ rotation(both[2])).ravel()

    jacobian = finite_difference(seen, np.concatenate([here, at_rest]))
    expected = jacobian @ block_diag(passage_cov, rest_cov) @ jacobian.T
    before = front.ekf.P.copy()
    front.reactivate(np.array([key_pose, here]), np.array([0]), passage_cov)
    np.testing.assert_array_equal(front.ekf.P[:7, :7], before)
    np.testing.assert_allclose(front.ekf.relative()[1][4:, 4:], expected, rtol=0, atol=1e-9)


@unhurried
@given(seeds, headings)
def test_a_woken_landmark_is_found_again(seed, heading):
    """Seen where it is expected, it is matched, corrects the pose, and nothing is born beside it."""
    front, key_pose, _ = resting(seed, heading)
    front.reactivate(np.array([key_pose, front.ekf.pose]), np.array([0]), NOWHERE)
    x, before = front.ekf.x.copy(), front.ekf.pose_cov
    positions = predict_corners(front.ekf.x, np.array([2, 3]))
    _, landmarks = front.observe(corners(positions, orientations=wrap_angle(0.4 + key_pose[2] - x[2])))
    assert landmarks.tolist() == [1, 2]
    assert front.table.observations.tolist() == [1, 2, 2, 1]
    np.testing.assert_allclose(front.ekf.x, x, atol=1e-9)
    assert np.linalg.eigvalsh(before - front.ekf.pose_cov).min() > -1e-12


def test_only_what_is_near_wakes_and_only_from_the_key_frames_named():
    front = front_end()
    front.observe(corners([[6.0, 0.0]]))
    front.deactivate_far(0, NOTHING)
    front.observe(corners([[6.0, 3.0], [0.0, 9.0]]))
    front.deactivate_far(1, NOTHING)
    front.move(pose(3.0, 0.0, 0.0), 1e-6 * np.eye(3))
    poses = np.array([pose(), pose(), front.ekf.pose])
    assert front.active.size == 0
    front.reactivate(poses, np.array([1]), NOWHERE)
    assert front.active.tolist() == [1]
    front.reactivate(poses, np.array([0, 1]), NOWHERE)
    assert front.active.tolist() == [1, 0]
    assert front.table.key_frames.tolist() == [ACTIVE, ACTIVE, 1]


def test_a_landmark_rests_at_the_key_frame_that_saw_it_last_however_far_the_robot_goes_before_it_rests():
    front = front_end()
    _, seen = front.observe(corners([[2.0, 1.0]]))
    front.deactivate_far(0, seen)
    for key_frame in (1, 2, 3, 4):
        front.move(pose(2.0, 0.0, 0.1), 1e-4 * np.eye(3))
        front.deactivate_far(key_frame, NOTHING)
    assert front.active.size == 0
    assert front.table.key_frames.tolist() == [0]
    np.testing.assert_allclose(front.table.positions[0], [2.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(front.table.covs[0], 0.05**2 * np.eye(2), atol=1e-9)  # nothing of the way since


@unhurried
@given(seeds, headings, headings)
def test_a_front_end_that_is_put_elsewhere_sees_the_same_landmarks(seed, heading, new_heading):
    front, key_pose, rng = resting(seed, heading)
    seen = predict_corners(front.ekf.x, np.array([0, 1]))
    orientation = wrap_angle(0.4 + key_pose[2] - front.ekf.x[2])
    front.rebase(pose(*rng.normal(0.0, 20.0, 2), new_heading), 0.01 * np.eye(3))
    _, landmarks = front.observe(corners(seen, orientations=orientation))
    assert landmarks.tolist() == [0, 3]
    np.testing.assert_allclose(
        wrap_angle(front.table.signatures().orientations[[0, 3]] - orientation - front.ekf.x[2]), 0, atol=1e-9
    )


def doubled(seed, heading=0.7, rules=FilterRules()):  # noqa: B008, frozen
    """Four landmarks, the first and the last of which are one; correlated by a drive."""
    rng = np.random.default_rng(seed)
    front = front_end(pose(1.0, 2.0, heading), np.diag([0.1, 0.1, 0.05]) ** 2, rules=rules)
    positions = np.array([[2.0, 1.0], [3.0, -1.0], [-1.0, 2.0], [2.0, 1.0]])
    # Near enough to be one, whatever the seed.
    positions[3] += rng.uniform(-0.05, 0.05, 2)
    front.observe(corners(positions))
    front.move(pose(0.3, 0.1, 0.2), np.diag([0.02, 0.02, 0.01]) ** 2)
    return front


@unhurried
@given(seeds, st.sampled_from([FilterRules().merge_sigma, 0.05]))
def test_merging_is_an_update_with_the_difference(seed, merge_sigma):
    """Of the dense Gaussian by Bayes' rule in information form, then without the second landmark."""
    front = doubled(seed, rules=FilterRules(merge_sigma=merge_sigma))
    H = np.zeros((2, 11))
    H[:, 3:5], H[:, 9:11] = np.eye(2), -np.eye(2)
    x, P = front.ekf.x.copy(), front.ekf.P.copy()
    cov = np.linalg.inv(np.linalg.inv(P) + H.T @ H / merge_sigma**2)
    expected = x - cov @ H.T @ (H @ x) / merge_sigma**2
    assert front.merge() == [(0, 3)]
    assert front.active.tolist() == [0, 1, 2]
    assert front.table.key_frames.tolist() == [ACTIVE, ACTIVE, ACTIVE, MERGED]
    assert front.table.observations[:3].tolist() == [2, 1, 1]
    np.testing.assert_allclose(front.ekf.x, expected[:9], rtol=0, atol=1e-8)
    np.testing.assert_allclose(front.ekf.P, cov[:9, :9], rtol=0, atol=1e-10)
    np.testing.assert_array_equal(front.ekf.P, front.ekf.P.T)
    assert np.linalg.eigvalsh(front.ekf.P).min() > 0.0
    assert front.merge() == []


def test_of_three_that_are_one_the_oldest_stays():
    front = front_end()
    front.observe(corners([[2.0, 1.0], [2.03, 1.0], [2.0, 1.03], [-2.0, 0.0]]))
    merged = front.merge()
    assert len(merged) == 2
    assert front.active.tolist() == [0, 3]
    assert front.table.observations[0] == 3
    np.testing.assert_allclose(front.ekf.landmarks[0], [2.01, 1.01], atol=1e-3)


ALIKE = {"positions": [2.05, 1.0], "openings": math.pi / 2, "orientations": 0.3, "convex": False}


@pytest.mark.parametrize(
    ("change", "merged"),
    [
        ({}, [(0, 1)]),
        ({"positions": [2.3, 1.0]}, []),
        ({"convex": True}, []),
        ({"openings": 2.2}, []),
        ({"orientations": 2.0}, []),
    ],
    ids=["alike", "too far for its covariance", "of the other kind", "of another opening", "of another direction"],
)
def test_landmarks_that_differ_stay_two(change, merged):
    one = {**ALIKE, "positions": [2.0, 1.0]}
    other = {**ALIKE, **change}
    front = front_end()
    front.observe(corners(**{name: np.array([one[name], other[name]]) for name in one}))
    assert front.active.tolist() == [0, 1]
    assert front.merge() == merged


def seen_through(scan, model, points):
    return look_at(scan, model, points) == PASSED


def ring(radius, count=360, clockwise=False, turned=0.0):
    angles = turned + 2.0 * math.pi / count * np.arange(count)
    return LaserScan(np.full(count, radius), -angles if clockwise else angles)


def sensor(**mounting):
    return SensorModel(0.01, 0.001, 0.1, 12.0, Mounting(**mounting))


MOUNTINGS = {
    "forward": {},
    "turned": {"x": 0.1, "theta": 0.8},
    "backward": {"x": 0.2, "y": -0.1, "theta": math.pi},
    "upside down": {"x": -0.1, "y": 0.3, "theta": 0.5, "upside_down": True},
    "upside down and backward": {"theta": math.pi, "upside_down": True},
}


@pytest.mark.parametrize("name", MOUNTINGS)
@pytest.mark.parametrize("clockwise", [False, True])
@given(headings, st.floats(1.0, 8.0), st.floats(0.0, 7.0), st.data())
def test_a_point_is_seen_through_where_all_beams_beside_it_end_behind(name, clockwise, bearing, distance, turned, data):
    """The beams beside a point, found by their directions in the robot frame, decide; the others do not matter."""
    model = sensor(**MOUNTINGS[name])
    mounting = model.mounting
    point = np.array([mounting.x, mounting.y]) + distance * np.array([math.cos(bearing), math.sin(bearing)])
    scan = ring(distance + BEHIND + 1e-6, clockwise=clockwise, turned=turned)
    away = wrap_angle(np.array([mounting.direction_to_robot(angle) for angle in scan.angles]) - bearing)
    # A beam at the point itself counts to one side or the other.
    assume(np.abs(away).min() > 1e-6)
    left, right = np.sort(away[away > 0.0])[:2], np.sort(-away[away < 0.0])[:2]
    beside = np.flatnonzero(np.isin(away, left) | np.isin(away, -right))
    assert len(beside) == 4
    assert seen_through(scan, model, point[None]).tolist() == [True]
    assert seen_through(ring(distance + BEHIND - 1e-6, 360, clockwise, turned), model, point[None]).tolist() == [False]
    ranges = np.full(360, 0.5)
    ranges[beside] = scan.ranges[0]
    assert seen_through(LaserScan(ranges, scan.angles), model, point[None]).all()
    blocked = scan.ranges.copy()
    blocked[data.draw(st.sampled_from(beside.tolist()))] = data.draw(
        st.sampled_from([0.0, 0.05, distance, distance + 0.1, math.inf, 13.0])
    )
    assert not seen_through(LaserScan(blocked, scan.angles), model, point[None]).any()


def test_a_gap_shows_nothing():
    """Half a turn of beams: nothing is known of what lies behind, nor, at its edge, of what no beam is near to."""
    angles = np.radians(np.arange(-90.0, 91.0))
    scan = LaserScan(np.full(angles.size, 8.0), angles)
    points = np.array([[3.0, 0.0], [-3.0, 0.0], [-3.0, -1.0], [0.5, -2.0], [-0.5, 3.0]])
    assert seen_through(scan, sensor(), points).tolist() == [True, False, False, True, False]
    # Beams too far apart to tell of a point between them.
    coarse = LaserScan(np.full(36, 8.0), np.radians(np.arange(0.0, 360.0, 10.0)))
    assert seen_through(coarse, sensor(), np.array([[0.5, 0.2], [5.0, 2.0]])).tolist() == [True, False]


@given(headings, st.floats(1.0, 8.0), st.floats(-0.6, 0.6))
def test_a_place_is_in_sight_where_beams_end_near_it(bearing, distance, off):
    """Within half of what counts as behind, on either side; a convex corner has half of the beams behind it."""
    assume(abs(abs(off) - 0.5 * BEHIND) > 1e-6)
    assume(abs(off - BEHIND) > 1e-6)
    point = distance * np.array([[math.cos(bearing), math.sin(bearing)]])
    shown = look_at(ring(distance + off), sensor(), point)[0]
    assert shown == (IN_SIGHT if abs(off) < 0.5 * BEHIND else PASSED if off > BEHIND else HIDDEN)
    scan = ring(distance)
    away = wrap_angle(scan.angles - bearing)
    # A beam at the point itself counts to one side or the other.
    assume(np.abs(away).min() > 1e-6)
    ahead = away > 0.0
    corner = LaserScan(np.where(ahead, distance, distance + 3.0), scan.angles)
    assert look_at(corner, sensor(), point).tolist() == [IN_SIGHT]


@pytest.mark.parametrize(("overlooked", "kept"), [(8, True), (9, False)])
def test_a_landmark_ends_when_it_was_seldom_seen_where_it_is_in_sight(overlooked, kept):
    """Seen once, and one more taken as granted: two of ten are the share of 0.2 that is asked, two of eleven less."""
    front = front_end()
    front.observe(corners([[2.0, 0.0]], orientations=math.pi))
    nothing = np.empty(0, np.int64)
    for _ in range(overlooked):
        front.count_misses(ring(2.0), sensor(), nothing)
    assert front.table.overlooked.tolist() == [overlooked]
    assert (front.active.size == 1) == kept
    counts = front.table.counts(1)
    assert (counts.seldom_seen, counts.pruned) == (0 if kept else 1, 0)


def test_a_place_farther_away_than_a_landmark_was_seen_from_tells_nothing():
    front = front_end()
    front.observe(corners([[2.0, 0.0]], orientations=math.pi))
    nothing = np.empty(0, np.int64)
    front.count_misses(ring(2.0), sensor(), nothing)
    front.move(pose(-0.5, 0.0, 0.0), np.zeros((3, 3)))
    for _ in range(20):
        front.count_misses(ring(2.5), sensor(), nothing)
    assert front.table.overlooked.tolist() == [1]


def test_a_place_from_which_one_wall_shows_tells_nothing():
    """The front of a pillar, seen at a right angle: its corner is there, but it cannot be found."""
    front = front_end()
    front.observe(corners([[2.0, 0.0]], convex=True, openings=math.pi / 2.0, orientations=math.radians(50.0)))
    for _ in range(20):
        front.count_misses(ring(2.0), sensor(), np.empty(0, np.int64))
    assert front.table.overlooked.tolist() == [0]


@pytest.mark.parametrize("beams", [0, 1, 3])
def test_a_scan_of_few_beams_or_none_sees_through_nothing_far_from_them(beams):
    scan = LaserScan(np.full(beams, 8.0), np.zeros(beams))
    assert seen_through(scan, sensor(), np.array([[-3.0, 0.0]])).tolist() == [False]
    assert seen_through(scan, sensor(), np.empty((0, 2))).tolist() == []


def test_a_landmark_ends_when_it_was_missed_more_often_than_seen():
    front = front_end()
    nothing = np.empty(0, np.int64)
    for _ in range(2):
        front.observe(corners([[2.0, 1.0], [-2.0, 1.0]]))
    front.count_misses(ring(9.0), sensor(), np.array([0, 1]))
    assert front.table.misses.tolist() == [0, 0]
    for count in (1, 2):
        front.count_misses(ring(9.0), sensor(), np.array([1, -1]))
        assert front.table.misses.tolist() == [count, 0]
        assert front.active.tolist() == [0, 1]
    x, P = front.ekf.x.copy(), front.ekf.P.copy()
    front.count_misses(ring(9.0), sensor(), np.array([1]))
    assert front.active.tolist() == [1]
    assert front.table.key_frames.tolist() == [REMOVED, ACTIVE]
    kept = np.r_[0:3, 5:7]
    np.testing.assert_array_equal(front.ekf.x, x[kept])
    np.testing.assert_array_equal(front.ekf.P, P[np.ix_(kept, kept)])
    # A wall in front of it is no miss.
    for _ in range(5):
        front.count_misses(ring(1.0), sensor(), nothing)
    assert front.active.tolist() == [1]


def test_a_landmark_that_is_gone_does_not_wake_and_may_be_born_again():
    front = front_end()
    front.observe(corners([[2.0, 1.0]]))
    for _ in range(2):
        front.count_misses(ring(9.0), sensor(), np.empty(0, np.int64))
    assert front.active.size == 0
    front.reactivate(np.array([pose(), pose()]), np.array([0, 1]), NOWHERE)
    assert front.active.size == 0
    assert front.observe(corners([[2.0, 1.0]]))[1].tolist() == [1]


def test_a_scan_of_no_beams_is_no_miss():
    front = front_end()
    front.observe(corners([[2.0, 1.0]]))
    front.count_misses(LaserScan(np.empty(0), np.empty(0)), sensor(), np.empty(0, np.int64))
    assert front.table.misses.tolist() == [0]


def test_what_is_seen_again_is_counted_and_what_is_new_gets_the_next_number():
    front = front_end()
    _, first = front.observe(corners([[2.0, 1.0], [3.0, -2.0]]))
    _, second = front.observe(corners([[-4.0, 0.0], [3.0, -2.0]]))
    assert first.tolist() == [0, 1]
    assert second.tolist() == [2, 1]
    assert front.table.observations.tolist() == [1, 2, 1]
    assert front.active.tolist() == [0, 1, 2]
    np.testing.assert_allclose(between(pose(), front.ekf.pose), pose(), atol=1e-9)


def test_a_corner_that_is_seen_from_afar_stays_one_landmark():
    """Farther than the front end keeps landmarks, but in sight of every key frame on the way."""
    front = front_end()
    for key_frame in range(4):
        _, seen = front.observe(corners([[1.5 * KEEP - 0.3 * key_frame, 0.0]]))
        front.deactivate_far(key_frame, seen)
        front.move(pose(0.3, 0.0, 0.0), 1e-6 * np.eye(3))
    assert len(front.table) == 1
