"""Filter and graph tell each other: landmarks merged in both, and the filter put where the graph has the robot."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from finite_difference import finite_difference
from observed_corners import corners
from scipy.stats import chi2

from features.se2 import between, compose, inverse, pose, rotation, transform, wrap_angle
from slam.coupling import close_loop, merge, rebase
from slam.filter.association import Gates
from slam.filter.front_end import FrontEnd
from slam.graph.incremental import LandmarkGraph
from slam.graph.values import Closure, Observations

START = pose(2.0, -1.0, math.pi / 2.0)
MOTION_COV = np.diag([0.03, 0.03, 0.01]) ** 2
CLOSURE_COV = np.array([[4e-4, 1e-4, 0.0], [1e-4, 1e-4, 2e-5], [0.0, 2e-5, 9e-6]])
"""Unlike in x and y, and correlated, so that its axes matter."""

PILLARS = transform(START, np.array([[2.0, 1.5], [1.0, -2.0], [3.0, -1.0]]))
KEEP_DISTANCE = 6.0


class Found:
    """What a search for loops has found: closures, and the key frames of the submap that they lead to."""

    def __init__(self, closures: Sequence[Closure], submap: Sequence[int] = ()) -> None:
        self.closures, self.of = list(closures), np.array(submap, np.int64)

    def find(self, poses_world_robot):
        return self.closures

    def submap(self, key_frame):
        return self.of


class Drive:
    """A filter and a graph that are told the same, key frame by key frame, from exact sightings of the pillars."""

    def __init__(self):
        gates = Gates("joint", 0.99, 0.9999, 0.5, math.radians(20.0), math.radians(20.0))
        self.front = FrontEnd(START, np.diag([1e-8, 1e-8, 1e-10]), gates, KEEP_DISTANCE)
        self.graph = LandmarkGraph(2.0)
        self.truth = START

    def go(self, motion, slip=None, *, sees=()):
        """Drive by a motion, of which odometry tells another one, and see some of the pillars."""
        motion = np.asarray(motion)
        self.truth = compose(self.truth, motion)
        told = motion if slip is None else compose(motion, slip)
        self.front.move(told, MOTION_COV)
        shown = transform(inverse(self.truth), PILLARS[list(sees)])
        seen = corners(shown, orientations=0.3 - self.truth[2], sigma=0.02)
        _, landmarks = self.front.observe(seen)
        observations = Observations(landmarks, seen.positions, seen.covs)
        self.graph.add_key_frame(self.front.ekf.pose, told, MOTION_COV, observations)
        self.graph.update()
        self.front.deactivate_far(len(self.graph) - 1, landmarks)
        return landmarks


def returned():
    """Away from the pillars, which come to rest, and back to where they were seen, by an odometry that has slipped."""
    drive = Drive()
    for step in (pose(), pose(0.5)):
        drive.go(step, sees=[0, 1, 2])
    for _ in range(4):
        drive.go(pose(3.0))
    drive.go(pose(-11.0, 0.2, 0.4), pose(0.5, -0.3, 0.1))
    assert drive.front.active.size == 0
    older = 1
    return drive, Closure(older, len(drive.graph) - 1, between(compose(START, pose(0.5)), drive.truth), CLOSURE_COV)


def assert_filter_is_where_the_graph_is(drive):
    np.testing.assert_allclose(drive.front.ekf.pose, drive.graph.poses_world_robot[-1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(drive.front.ekf.pose_cov, drive.graph.newest_cov(), rtol=1e-9, atol=1e-15)


def test_merged_landmarks_are_one_in_filter_and_graph():
    drive = Drive()
    drive.front.observe(corners([[2.0, 1.0], [2.03, 1.0], [-2.0, 0.0]]))
    merge(drive.front, drive.graph)
    assert drive.front.active.tolist() == [0, 2]
    assert [drive.graph.resolve(landmark) for landmark in range(3)] == [0, 0, 2]


def test_rebased_the_filter_has_the_pose_of_the_graph_and_landmarks_stay_where_they_are_seen():
    drive = Drive()
    for step in (pose(), pose(0.5, 0.0, 0.2)):
        drive.go(step, sees=[0, 1, 2])
    # What odometry of the graph alone would have moved: the filter has not seen this key frame's pillars yet.
    drive.front.move(pose(0.3, -0.2, 0.1), MOTION_COV)
    positions, cov = drive.front.ekf.relative()
    assert rebase(drive.front, drive.graph)
    assert_filter_is_where_the_graph_is(drive)
    after, after_cov = drive.front.ekf.relative()
    np.testing.assert_allclose(after, positions, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(after_cov, cov, rtol=1e-9, atol=1e-12)


def test_where_the_graph_cannot_tell_how_certain_it_is_the_filter_stays():
    drive = Drive()
    drive.go(pose(), sees=[0, 1])
    # A motion without any error has no information that could be written down.
    drive.graph.add_key_frame(pose(), pose(1.0), np.zeros((3, 3)), Observations(*_nothing()))
    drive.graph.update()
    x, P = drive.front.ekf.x.copy(), drive.front.ekf.P.copy()
    assert not rebase(drive.front, drive.graph)
    closure = Closure(0, 1, pose(0.5), CLOSURE_COV)
    close_loop(Found([closure], [0]), drive.front, drive.graph)
    np.testing.assert_array_equal(drive.front.ekf.x, x)
    np.testing.assert_array_equal(drive.front.ekf.P, P)


def _nothing():
    return np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 2, 2))


def test_where_no_loop_is_found_nothing_changes():
    drive, _ = returned()
    before = drive.front.ekf.pose, drive.graph.poses_world_robot.copy()
    close_loop(Found([], [0, 1]), drive.front, drive.graph)
    np.testing.assert_array_equal(drive.front.ekf.pose, before[0])
    np.testing.assert_array_equal(drive.graph.poses_world_robot, before[1])
    assert drive.graph.closures == ()
    assert drive.front.active.size == 0


def test_a_closed_loop_takes_the_filter_back_to_where_the_robot_is_and_wakes_what_it_saw_there():
    """Closure and sightings are exact, so the robot comes out where it is, and the pillars where they stand.

    Motions of six key frames say otherwise by half a metre with a sigma of some 0.07 m; a closure of 0.002 m outweighs
    them a thousand times.
    """
    drive, closure = returned()
    closure = replace(closure, cov=1e-2 * CLOSURE_COV)
    off = np.hypot(*(drive.front.ekf.pose - drive.truth)[:2])
    close_loop(Found([closure], [0, 1]), drive.front, drive.graph)
    assert drive.graph.closures == (closure,)
    assert_filter_is_where_the_graph_is(drive)
    error = drive.front.ekf.pose - drive.truth
    assert off > 0.5
    assert np.hypot(*error[:2]) < 0.03
    assert abs(wrap_angle(error[2])) < math.radians(0.5)
    assert sorted(drive.front.active.tolist()) == [0, 1, 2]
    # Where the key frame that saw them last now is, with what it saw.
    poses = drive.graph.poses_world_robot
    seen = transform(inverse(compose(START, pose(0.5))), PILLARS[drive.front.active])
    np.testing.assert_allclose(drive.front.ekf.landmarks, transform(poses[1], seen), rtol=0.0, atol=1e-9)
    # Seen again they are the same landmarks.
    landmarks = drive.go(pose(0.2), sees=[0, 1, 2])
    assert landmarks.tolist() == [0, 1, 2]


def test_woken_landmarks_are_as_uncertain_from_here_as_closure_and_sighting_together():
    """Against the first-order covariance of where the pillars are from here, by the closure's motion and the sighting.

    The closure's covariance is told in the axes of the older key frame, here a quarter turn from those of the world.
    """
    drive, closure = returned()
    settled = drive.front.table.covs.copy()
    close_loop(Found([closure], [0, 1]), drive.front, drive.graph)
    local, poses = drive.front.active, drive.graph.poses_world_robot
    positions, cov = drive.front.ekf.relative()
    motion = between(poses[1], poses[-1])
    from_older = transform(inverse(poses[1]), drive.front.ekf.landmarks)

    def by_motion(motion):
        return transform(inverse(motion), from_older).ravel()

    J = finite_difference(by_motion, motion)
    np.testing.assert_allclose(by_motion(motion), positions.ravel(), rtol=0.0, atol=1e-9)
    expected = J @ CLOSURE_COV @ J.T
    turn = rotation(motion[2]).T
    for k, landmark in enumerate(local):
        own = slice(2 * k, 2 * k + 2)
        expected[own, own] += turn @ settled[landmark] @ turn.T
    np.testing.assert_allclose(cov, expected, rtol=0.0, atol=1e-6 * expected.max())


def test_a_closure_by_an_earlier_key_frame_moves_the_filter_and_wakes_nothing():
    """A closure of the newest key frame tells where the robot is among the landmarks, one of another does not."""
    drive, closure = returned()
    closure = replace(closure, cov=1e-2 * CLOSURE_COV)
    drive.go(pose(0.2))
    close_loop(Found([closure], [0, 1]), drive.front, drive.graph)
    assert_filter_is_where_the_graph_is(drive)
    # As well as the closure puts it, and one more motion of 0.03 m that is exact here.
    assert np.hypot(*(drive.front.ekf.pose - drive.truth)[:2]) < 0.03
    assert drive.front.active.size == 0


@pytest.mark.parametrize("submap", [[], [3, 4]])
def test_only_landmarks_of_the_submap_that_is_seen_again_become_active_again(submap):
    drive, closure = returned()
    close_loop(Found([closure], submap), drive.front, drive.graph)
    assert_filter_is_where_the_graph_is(drive)
    assert drive.front.active.size == 0


def test_landmarks_born_again_before_the_loop_was_closed_are_merged_with_those_that_wake():
    """Back at the pillars the filter, half a metre off, takes them for new ones, until the loop is closed."""
    drive, _ = returned()
    again = drive.go(pose(0.2), sees=[0, 1, 2])
    assert again.tolist() == [3, 4, 5]
    older = compose(START, pose(0.5))
    close_loop(
        Found([Closure(1, len(drive.graph) - 1, between(older, drive.truth), 1e-2 * CLOSURE_COV)], [0, 1]),
        drive.front,
        drive.graph,
    )
    assert [drive.graph.resolve(landmark) for landmark in (3, 4, 5)] == [0, 1, 2]
    assert sorted(drive.front.active.tolist()) == [0, 1, 2]
    errors = drive.front.ekf.landmarks - PILLARS[drive.front.active]
    sigma = math.sqrt(float(np.trace(drive.front.ekf.landmark_covs[0])))
    assert np.abs(errors).max() < math.sqrt(chi2.ppf(0.9999, 2)) * sigma
