"""Loops round a corridor: closures are found where they are true, as good as they say, and nowhere else."""

import math
from functools import cache

import numpy as np
import pytest
from registration_scenes import CORRIDOR, seen
from scipy.stats import chi2

from features.feature import CORNER_RECORD, Corners
from features.se2 import between, compose, inverse, pose, wrap_angle
from sim.worlds.world import World
from slam.loop.closer import LoopCloser
from slam.loop.rules import LoopRules

APART, REACH, SHARE = 15.0, 5.0, 0.6
NO_CORNERS = Corners(np.empty(0, CORNER_RECORD))
UNTOLD = 1e4 * np.eye(3)
"""Covariance of a motion of which odometry tells nothing."""
STEP = 0.5
DRIFT = np.array([0.4, -0.3, math.radians(3.0)])
"""How far the estimate has drifted when the robot is back, about the start of the loop [m, m, rad]."""


def closer_of(share=SHARE):
    return LoopCloser(apart=APART, reach=REACH, share=share)


def show(closer, scan, travel, poses_world_robot):
    """What is found when the next key frame is seen, of whose motion odometry knows no more than its length."""
    closer.add_key_frame(scan, NO_CORNERS, pose(travel), UNTOLD)
    closures = closer.find(poses_world_robot)
    assert len(closures) <= 1
    return closures[0] if closures else None


def box(x, y, width, depth):
    return np.array([[x, y], [x + width, y], [x + width, y + depth], [x, y + depth]])


BLOCK = box(2.5, 2.5, 15.0, 7.0)
PILLARS = [
    box(3.5, 2.2, 0.6, 0.3),
    box(7.0, 0.0, 0.5, 0.4),
    box(11.5, 2.1, 0.4, 0.4),
    box(15.0, 0.0, 0.8, 0.3),
    box(19.6, 5.0, 0.4, 0.7),
    box(12.0, 11.7, 0.5, 0.3),
    box(6.0, 9.5, 0.6, 0.4),
    box(0.0, 7.0, 0.3, 0.6),
]
RING = World.from_polygons("ring", [box(0.0, 0.0, 20.0, 12.0), BLOCK, *PILLARS])
"""A corridor of 2.5 m round a block, with a few pillars on its walls, no two alike."""

ROUND = np.array([[1.25, 1.25], [18.75, 1.25], [18.75, 10.75], [1.25, 10.75]])


def along(waypoints, count):
    """Poses every STEP along a closed way, from its first point on."""
    legs = np.roll(waypoints, -1, axis=0) - waypoints
    lengths = np.hypot(*legs.T)
    poses = []
    for k in range(count):
        way = (k * STEP) % lengths.sum()
        leg = int(np.searchsorted(np.cumsum(lengths), way, side="right"))
        at = (way - lengths[:leg].sum()) / lengths[leg]
        poses.append(pose(*(waypoints[leg] + at * legs[leg]), math.atan2(legs[leg][1], legs[leg][0])))
    return np.array(poses)


def drifting(truth, drift=DRIFT, first=16):
    """An estimate that is exact for the first key frames and then drifts off evenly, to the last one."""
    home = truth[0]
    estimate = truth.copy()
    for k in range(first, len(truth)):
        share = (k - first) / (len(truth) - 1 - first)
        estimate[k] = compose(compose(home, share * drift), compose(inverse(home), truth[k]))
    return estimate


LAP = round(2 * (17.5 + 9.5) / STEP)


@cache
def lap(seed):
    """Once round the ring and 6 m on: what is found at each key frame, the truth and the estimate."""
    rng = np.random.default_rng(seed)
    truth = along(ROUND, LAP + 12)
    truth += rng.normal(0.0, [0.05, 0.05, 0.03], truth.shape)
    estimate = drifting(truth, rng.normal(0.0, [0.3, 0.3, math.radians(2.0)]))
    closer = closer_of()
    closures = []
    for k, here in enumerate(truth):
        closures.append(show(closer, seen(RING, here, rng), STEP, estimate[: k + 1]))
    return closures, truth, estimate


SEEDS = range(12)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_loop_is_closed_where_it_closes_and_not_before(seed):
    closures, truth, _ = lap(seed)
    found = [closure for closure in closures if closure is not None]
    assert found
    for closure in found:
        assert np.hypot(*(truth[closure.older] - truth[closure.newer])[:2]) < REACH + 1.0
        assert (closure.newer - closure.older) * STEP > APART
    # Two looks that agree are enough once the place is seen again.
    assert found[0].newer <= LAP + 6


def test_closures_are_as_good_as_they_say():
    """NEES of the first closure of each lap below its chi-square bound, even by what the scan says alone.

    What two registrations of the same real place share is added to that; a simulated world has nothing of it. Nor are
    its walls rough, as those are that a registration allows for: so there is no bound from below.
    """
    nees, errors = [], []
    for seed in SEEDS:
        closures, truth, _ = lap(seed)
        closure = next(closure for closure in closures if closure is not None)
        error = closure.motion - between(truth[closure.older], truth[closure.newer])
        error[2] = wrap_angle(error[2])
        nees.append(error @ np.linalg.solve(closure.cov - LoopRules().systematic_cov, error))
        errors.append(np.hypot(*error[:2]))
    assert np.mean(nees) < chi2.ppf(0.999, 3 * len(nees)) / len(nees)
    assert max(nees) < chi2.ppf(0.9999, 3)
    assert max(errors) < 0.02


def test_the_covariance_of_a_closure_is_one():
    closures, _, _ = lap(0)
    for closure in closures:
        if closure is not None:
            np.testing.assert_allclose(closure.cov, closure.cov.T, atol=1e-12)
            assert np.linalg.eigvalsh(closure.cov).min() > 0.0
            assert -math.pi <= closure.motion[2] < math.pi


def test_a_closure_does_not_depend_on_the_world_frame():
    g = pose(30.0, -20.0, 2.5)
    rng = np.random.default_rng(5)
    truth = along(ROUND, LAP + 8)
    estimate = drifting(truth)
    moved = np.array([compose(g, each) for each in estimate])
    here, there = closer_of(), closer_of()
    compared = 0
    for k, each in enumerate(truth):
        if 20 < k < LAP - 2:
            # The other side of the ring takes no part.
            for closer in (here, there):
                closer.add_key_frame(seen(CORRIDOR, pose(), rng), NO_CORNERS, pose(STEP), UNTOLD)
            continue
        scan = seen(RING, each, rng)
        closures = []
        for closer, poses in ((here, estimate), (there, moved)):
            closures.append(show(closer, scan, STEP, poses[: k + 1]))
        assert (closures[0] is None) == (closures[1] is None)
        if closures[0] is not None:
            np.testing.assert_allclose(closures[0].motion, closures[1].motion, atol=1e-4)
            np.testing.assert_allclose(closures[0].cov, closures[1].cov, rtol=1e-2, atol=1e-8)
            compared += 1
    assert compared >= 2


def two_corridors(shift):
    """Two corridors side by side behind one wall, as like as two; pillars of the second one at other places."""
    first = [box(4.0, 0.0, 0.6, 0.4), box(9.0, 1.7, 0.5, 0.3), box(14.0, 0.0, 0.4, 0.5)]
    second = [pillar + np.array([shift, 2.5]) for pillar in first]
    rooms = [box(0.0, 0.0, 20.0, 2.0), box(0.0, 2.5, 20.0, 2.0)]
    return World.from_polygons("two corridors", [*rooms, *first, *second])


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_a_corridor_never_seen_is_not_taken_for_its_neighbour(shift):
    """2.5 m to the side there is one that looks the same: nearer than the reach, but not where the estimate may err."""
    rng = np.random.default_rng(1)
    world = two_corridors(shift)
    there = [pose(x, 1.0, 0.0) for x in np.arange(1.0, 19.0, STEP)]
    back = [pose(x, 3.5, math.pi) for x in np.arange(18.5, 1.0, -STEP)]
    truth = np.array([*there, *back])
    closer = closer_of()
    for k, here in enumerate(truth):
        assert show(closer, seen(world, here, rng), STEP, truth[: k + 1]) is None


def test_a_bare_corridor_is_no_place():
    """Seen again or not, nothing in it says where along it the robot is."""
    rng = np.random.default_rng(2)
    truth = np.array([pose(0.5 * k, 0.0, 0.0) for k in range(40)] + [pose(20.0 - 0.5 * k, 0.0, 0.0) for k in range(30)])
    closer = closer_of()
    for k, here in enumerate(truth):
        assert show(closer, seen(CORRIDOR, here, rng), STEP, truth[: k + 1]) is None


def revisit(looks, rng, share=SHARE, turn=0.0):
    """Seven metres of the ring, far away round it, and then key frames that show it again, or not (None).

    From one to the next the robot goes on, and turns on the spot by so much more [rad].
    """
    truth = along(ROUND, 14)
    estimate = [*truth]
    closer = closer_of(share)
    for k, here in enumerate(truth):
        assert show(closer, seen(RING, here, rng), STEP, truth[: k + 1]) is None
    found = []
    for k, (look, correction) in enumerate(looks):
        at = compose(truth[3 + k], pose(0.0, 0.0, k * turn))
        estimate.append(compose(pose(1.25, 1.25), compose(correction, between(pose(1.25, 1.25), at))))
        shown = seen(RING, at, rng) if look else seen(CORRIDOR, pose(), rng)
        found.append(show(closer, shown, STEP if k else 40.0, np.array(estimate)) is not None)
    return found


HERE, OFF, TURNED = pose(0.3, 0.2, 0.03), pose(-0.4, 0.2, 0.03), pose(0.3, 0.2, 0.13)


def test_a_single_look_is_not_believed():
    rng = np.random.default_rng(3)
    assert revisit([(True, HERE), (False, HERE), (True, HERE), (False, HERE)], rng) == [False] * 4
    assert revisit([(True, HERE), (True, HERE)], rng) == [False, True]


def test_a_place_that_shows_other_things_than_walls_seen_before_is_not_believed():
    """Some of the points of any scan lie on no wall seen before: noise, and what only now comes in sight."""
    looks = [(True, HERE), (True, HERE)]
    assert revisit(looks, np.random.default_rng(3), share=1.0) == [False, False]


@pytest.mark.parametrize("other", [OFF, TURNED], ids=["position", "heading"])
def test_two_looks_that_contradict_each_other_are_not_believed(other):
    """The estimate goes on by odometry: what moved it by one way a moment ago cannot be another way now."""
    rng = np.random.default_rng(4)
    assert revisit([(True, HERE), (True, other), (True, other)], rng) == [False, False, True]


@pytest.mark.parametrize("turn", [0.5 * math.pi, math.pi, -0.5 * math.pi])
def test_two_looks_agree_however_the_robot_turns_between_them(turn):
    """What lays the robot on the walls moves the world, and that does not turn."""
    assert revisit([(True, HERE), (True, HERE)], np.random.default_rng(3), turn=turn) == [False, True]


def test_a_place_is_left_before_it_may_be_closed():
    """Standing about in one place is no loop, however long; nor are looks nearer than the spacing."""
    rng = np.random.default_rng(6)
    closer = closer_of()
    here = pose(9.0, 1.25)
    for k in range(20):
        assert show(closer, seen(RING, here, rng), 0.5, np.tile(here, (k + 1, 1))) is None


def test_the_passage_of_a_key_frame_is_the_way_about_it_on_that_visit():
    rng = np.random.default_rng(7)
    closer = closer_of()
    scan = seen(RING, pose(9.0, 1.25), rng)
    for _ in range(81):
        closer.add_key_frame(scan, NO_CORNERS, pose(1.0), UNTOLD)
    # 16 m to either side; and never what is nearer to now than two visits are apart.
    assert closer.submap(30).tolist() == list(range(14, 47))
    assert closer.submap(60).tolist() == list(range(44, 65))


@pytest.mark.parametrize(("sigma", "believed"), [(100.0, True), (0.1, False)])
def test_walls_of_a_place_where_odometry_cannot_be_are_those_of_a_copy(sigma, believed):
    """The estimate puts the robot back to the ring, where both looks fit; odometry says that it is 40 m away."""
    rng = np.random.default_rng(3)
    truth = along(ROUND, 16)
    scans = [seen(RING, here, rng) for here in truth]
    closer = closer_of()
    for scan in scans:
        closer.add_key_frame(scan, NO_CORNERS, pose(STEP), 1e-6 * np.eye(3))
    for k, step in ((3, 40.0), (4, STEP)):
        closer.add_key_frame(scans[k], NO_CORNERS, pose(step), sigma**2 * np.eye(3) if k == 3 else 1e-6 * np.eye(3))
        truth = np.concatenate([truth, truth[k : k + 1]])
        found = closer.find(truth)
    assert bool(found) == believed
    assert closer.counts.accepted == believed


@pytest.mark.parametrize(("between_looks", "believed"), [(STEP, True), (2.5, False)])
def test_a_look_that_is_long_ago_confirms_nothing(between_looks, believed):
    """Two looks agree, but between them odometry has gone farther than what the first one says would hold."""
    rng = np.random.default_rng(3)
    truth = along(ROUND, 16)
    closer = closer_of()
    for k, here in enumerate(truth):
        assert show(closer, seen(RING, here, rng), STEP, truth[: k + 1]) is None
    estimate = np.concatenate([truth, truth[3:5]])
    assert show(closer, seen(RING, truth[3], rng), 40.0, estimate[:-1]) is None
    found = show(closer, seen(RING, truth[4], rng), between_looks, estimate)
    assert (found is not None) == believed
