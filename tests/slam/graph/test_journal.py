"""A graph that is kept in a file goes on to the same bytes as one that never was, whatever it is told and asked."""

import pickle

import numpy as np
import pytest

from features.se2 import between, compose, pose, rotation
from slam.graph.incremental import LandmarkGraph
from slam.graph.journal import JournaledGraph
from slam.graph.values import Closure, Observations

LANDMARKS = np.random.default_rng(0).uniform(-4.0, 4.0, (6, 2))
ALIAS = 10
"""Beginning of second names that landmarks are given for a while, to be merged."""


def kept(graph):
    return pickle.loads(pickle.dumps(graph))


def told(seed, count=14):
    """What a run tells a graph key frame by key frame: names of methods and their arguments, in a fixed order."""
    rng = np.random.default_rng(seed)
    motion_cov, point_cov = np.diag([0.02, 0.02, 0.01]) ** 2, np.diag([0.03, 0.02]) ** 2
    truth, here = [], pose(0.5, -0.5, 3.0)
    for key in range(count):
        motion = pose(*rng.normal([0.5, 0.0, 0.6], 0.1))
        here = compose(here, motion) if key else here
        truth.append(here)
        which = np.sort(rng.choice(6, 4, replace=False))
        positions = (LANDMARKS[which] - here[:2]) @ rotation(here[2]) + rng.normal(0.0, 0.02, (4, 2))
        names = np.where((which == 2) & (key >= 5) & (key < 9), ALIAS + which, which)
        seen = Observations(names, positions, np.repeat(point_cov[None], 4, axis=0))
        yield "add_key_frame", (here, motion + rng.multivariate_normal(np.zeros(3), motion_cov), motion_cov, seen)
        if key == 8:
            yield "merge", (2, ALIAS + 2)
        yield "update", ()
        if key in (7, 10):
            yield "newest_cov", ()
        if key in (9, 12):
            motion = between(truth[key - 8], here) + rng.normal(0.0, 0.01, 3) + (key == 12) * np.array([1.0, 0.0, 0.0])
            yield "add_closure", (Closure(key - 8, key, motion, 1e-4 * np.eye(3)),)
            yield "update", ()


def outcome(graph):
    """All that can be asked of a graph, as bytes."""
    newest, poses = graph.newest_cov(), graph.poses_world_robot
    estimate = graph.optimize(50)
    revoked = [closure.newer for closure in estimate.revoked]
    marginals = graph.pose_covs(estimate, np.arange(len(graph)))
    numbers = [newest, poses, estimate.poses_world_robot, estimate.positions_world, estimate.covs, marginals]
    return [np.asarray(each).tobytes() for each in numbers], estimate.landmarks.tolist(), revoked


@pytest.mark.parametrize("at", range(0, 38, 3))
def test_read_back_anywhere_it_goes_on_to_the_same_bytes(at):
    one, other = JournaledGraph(2.0), JournaledGraph(2.0)
    for k, (name, arguments) in enumerate(told(0)):
        if k == at:
            other = kept(kept(other))
        getattr(one, name)(*arguments)
        getattr(other, name)(*arguments)
    assert outcome(kept(other)) == outcome(one) == outcome(other)


def test_it_is_the_graph_that_is_not_kept():
    plain, journaled = LandmarkGraph(2.0), JournaledGraph(2.0)
    for name, arguments in told(1):
        getattr(plain, name)(*arguments)
        getattr(journaled, name)(*arguments)
    expected = outcome(plain)
    assert outcome(journaled) == expected
    assert expected[2] == [12]
    assert len(journaled) == len(kept(journaled)) == 14
    assert kept(journaled).resolve(ALIAS + 2) == 2
    assert [closure.newer for closure in kept(journaled).closures] == [9, 12]


LOOKS = ["poses_world_robot", "closures", "optimize", "unsolved", "pose_covs", "distances2", "resolve", "newest_cov"]


@pytest.mark.parametrize("look", LOOKS)
def test_what_it_was_asked_before_makes_no_difference(look):
    """A copy is told what the graph was told, in the same order: a look is in the journal, or leaves no trace."""
    graph = JournaledGraph(2.0)
    for k, (name, arguments) in enumerate(told(2)):
        getattr(graph, name)(*arguments)
        if name != "update" or k < 8 or k % 3:
            continue
        if look in ("poses_world_robot", "closures"):
            getattr(graph, look)
        elif look in ("pose_covs", "distances2"):
            estimate = graph.optimize(20)
            pairs = np.array([[0, 1]])
            graph.pose_covs(estimate, np.array([0])) if look == "pose_covs" else graph.distances2(
                estimate, pairs, np.zeros(1)
            )
        else:
            getattr(graph, look)(*{"optimize": (20,), "resolve": (2,)}.get(look, ()))
    assert outcome(kept(graph)) == outcome(graph)


def test_every_look_is_among_those_that_are_tried_and_every_order_among_those_that_are_given():
    """A method that is new to the graph has to be tried by one of the laws above."""
    public = {name for name in dir(JournaledGraph) if not name.startswith("_")}
    assert public == {*LOOKS, *(name for name, _ in told(0))}


def test_reading_back_does_not_share_what_is_told_later():
    graph = JournaledGraph(2.0)
    orders = list(told(3))
    for name, arguments in orders[:10]:
        getattr(graph, name)(*arguments)
    copy = kept(graph)
    length = len(copy)
    for name, arguments in orders[10:]:
        getattr(graph, name)(*arguments)
    assert len(copy) == length < len(graph)
    assert len(kept(copy)) == length
