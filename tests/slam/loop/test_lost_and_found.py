"""Places recognised by their corners: by a robot that is metres off, and not where a building repeats itself."""

import math

import numpy as np
import pytest
from registration_scenes import CONFIG, LIDAR, SENSOR, points_of

from features.extraction import extract
from features.se2 import between, compose, pose
from sim.worlds.world import World
from slam.graph.incremental import LandmarkGraph
from slam.graph.values import Observations
from slam.loop.rules import LoopRules

from .test_closer import LAP, NO_CORNERS, PILLARS, RING, ROUND, along, box, closer_of

NOTHING_SEEN = Observations(np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 2, 2)))
MOTION_COV = np.diag([0.005, 0.005, math.radians(0.1)]) ** 2
"""Covariance of a motion of one step, of which the key frames of these tests know the truth."""

SLIP = pose(4.0, -5.0, math.radians(25.0))
SLIP_COV = np.diag([4.0, 4.0, math.radians(30.0)]) ** 2


def drive(world, truth, seed, slips=None, *, corners_seen=True):
    """Drive a way, with a graph that takes in what is found at each key frame: that, and the closer.

    ``slips`` : error of the motion up to a key frame, and the covariance that is told of it, by key frame.
    ``corners_seen`` : whether the key frames have corners, or walls only.
    """
    rng = np.random.default_rng(seed)
    closer = closer_of()
    graph, found = LandmarkGraph(cauchy_scale=2.0), []
    for k, here in enumerate(truth):
        motion, cov = between(truth[k - 1], here) if k else pose(), MOTION_COV
        if slips and k in slips:
            slip, cov = slips[k]
            motion = compose(motion, slip)
        graph.add_key_frame(here, motion, cov, NOTHING_SEEN)
        graph.update()
        scan = LIDAR.scan(world, here, 0.0, rng)
        corners = extract(scan, SENSOR, CONFIG.extraction).corners.to_robot(SENSOR.mounting)
        corners = corners if corners_seen else NO_CORNERS
        closer.add_key_frame(points_of(scan), corners, motion, cov)
        found.append(closer.find(graph.poses_world_robot))
        for closure in found[-1]:
            graph.add_closure(closure)
        graph.update()
    return found, closer


def true(closure, truth):
    dx, dy, turn = between(between(truth[closure.older], truth[closure.newer]), closure.motion)
    return math.hypot(dx, dy) < 0.05 and abs(turn) < math.radians(1.0)


@pytest.mark.parametrize("seed", range(1))
def test_a_robot_that_is_metres_off_finds_its_way_back(seed):
    """Half way round odometry slips by 6 m and 25 deg, and says that it may have."""
    truth = along(ROUND, LAP + 30)
    found, closer = drive(RING, truth, seed, {LAP // 2: (SLIP, SLIP_COV)})
    closures = [closure for each in found for closure in each]
    assert closer.counts.proposed_by_corners > 0
    assert closer.counts.accepted == len(closures) > 0
    assert all(true(closure, truth) for closure in closures)
    # All supporting key frames of a submap enter at once.
    first = next(each for each in found if any(closure.older < LAP // 2 < closure.newer for closure in each))
    assert len(first) >= LoopRules().supporters
    assert len({closure.newer for closure in first}) == len(first)


def test_what_dead_reckoning_denies_is_not_believed():
    """The same slip, of which odometry says nothing: the same walls are then those of a place that looks the same."""
    found, _ = drive(RING, along(ROUND, LAP + 30), 0, {LAP // 2: (SLIP, MOTION_COV)})
    assert not [closure for each in found for closure in each if closure.older < LAP // 2 < closure.newer]


def rings(count):
    """The ring so many times, 30 m apart."""
    outlines = [box(0.0, 0.0, 20.0, 12.0), box(2.5, 2.5, 15.0, 7.0), *PILLARS]
    copies = [outline + np.array([30.0 * k, 0.0]) for k in range(count) for outline in outlines]
    return World.from_polygons("rings", copies)


def laps(count, steps):
    """So many steps round each of the rings, one after the other."""
    return np.concatenate([along(ROUND, steps) + np.array([30.0 * k, 0.0, 0.0]) for k in range(count)])


def test_a_room_that_is_a_copy_is_not_taken_for_the_first():
    truth = laps(2, LAP - 8)
    found, _ = drive(rings(2), truth, 1)
    assert all(true(closure, truth) for each in found for closure in each)


@pytest.mark.slow
def test_a_robot_that_is_lost_among_copies_says_nothing():
    """Lost before the third of three rooms that are alike, it could be in any; 5 m further on it does not know."""
    steps = LAP - 8
    truth = laps(3, steps)[: 2 * steps + 12]
    found, closer = drive(rings(3), truth, 2, {2 * steps: (pose(1.0, 1.0, 0.3), np.diag([60.0, 60.0, 3.0]) ** 2)})
    assert closer.counts.proposed_by_corners >= 2
    assert closer.counts.rejected >= 2
    assert all(true(closure, truth) for each in found for closure in each)


OFF_COV = np.diag([3.0, 3.0, math.radians(6.0)]) ** 2


def slipped(seed):
    """2 to 6 m into any direction, and up to 10 deg."""
    rng = np.random.default_rng(seed)
    distance, direction = rng.uniform(2.0, 6.0), rng.uniform(-math.pi, math.pi)
    turn = math.radians(rng.uniform(-10.0, 10.0))
    return pose(distance * math.cos(direction), distance * math.sin(direction), turn)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_robot_that_is_metres_off_finds_its_way_back_by_walls_alone(seed):
    """The far side of the ring is in the region too, and looks much the same."""
    truth = along(ROUND, LAP + 30)
    found, closer = drive(RING, truth, seed, {LAP // 2: (slipped(100 + seed), OFF_COV)}, corners_seen=False)
    closures = [closure for each in found for closure in each]
    assert closer.counts.proposed_by_walls > 0
    assert closer.counts.proposed_by_corners == 0
    assert [closure for closure in closures if closure.older < LAP // 2 < closure.newer]
    assert all(true(closure, truth) for closure in closures)


BARE_RING = World.from_polygons("bare ring", [box(0.0, 0.0, 20.0, 12.0), box(2.5, 2.5, 15.0, 7.0)])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_far_side_of_a_bare_ring_is_not_taken_for_the_near_one(seed):
    """They differ by nothing but the way into them, all along which beams would go through walls."""
    truth = along(ROUND, LAP + 30)
    found, closer = drive(BARE_RING, truth, seed, {LAP // 2: (slipped(seed), OFF_COV)}, corners_seen=False)
    assert closer.counts.proposed_by_walls > 0
    assert all(true(closure, truth) for each in found for closure in each)


@pytest.mark.slow
def test_a_robot_that_is_lost_among_copies_says_nothing_by_walls():
    steps = LAP - 8
    truth = laps(3, steps)[: 2 * steps + 24]
    lost = {2 * steps: (pose(1.0, 1.0, 0.1), np.diag([20.0, 3.0, 0.1]) ** 2)}
    found, _ = drive(rings(3), truth, 2, lost, corners_seen=False)
    assert all(true(closure, truth) for each in found for closure in each)
