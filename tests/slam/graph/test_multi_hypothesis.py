"""Associations of a whole run: the filters against ours, what is seen at once, and the map without identities."""

import math

import numpy as np
import pytest

from features.feature import Corners
from features.se2 import compose, pose, transform_inverse
from features.signature import Signatures
from slam.filter.ekf import POSE_DIM, LandmarkEkf
from slam.graph.incremental import LandmarkGraph
from slam.graph.multi_hypothesis import Sighting, most_likely
from slam.graph.multi_hypothesis_kernel import branch, move, score
from slam.graph.reassociation import reassociate
from slam.graph.rules import MultiHypothesisRules

FIRST_COV = np.diag([1e-8, 1e-8, 1e-10])
MOTION_COV = np.diag([0.01, 0.01, 0.02]) ** 2
# Two pairs, 8 sigma of a look apart, and two that stand alone.
LANDMARKS = np.array([[3.0, 1.0], [3.0, 1.4], [-2.0, 2.0], [-2.4, 2.0], [0.0, -3.0], [4.0, -2.0]])


def points(positions, sigma=0.05):
    covs = np.tile(sigma**2 * np.eye(2), (len(positions), 1, 1))
    return Corners.of(np.asarray(positions).reshape(-1, 2), covs, Signatures.of_points(len(positions)))


def drive(seed, steps=80):
    """Sightings of a robot that goes round, and which landmarks they are; each is seen by half of the looks."""
    rng = np.random.default_rng(seed)
    true, motion = pose(), pose()
    for _ in range(steps):
        seen = np.flatnonzero(rng.uniform(size=len(LANDMARKS)) < 0.5)
        positions = transform_inverse(true, LANDMARKS[seen]) + rng.normal(0.0, 0.05, (seen.size, 2))
        yield Sighting(motion, MOTION_COV, points(positions)), seen
        motion = pose(0.2, 0.0, 0.2)
        true = compose(true, motion + np.sqrt(np.diag(MOTION_COV)) * rng.normal(size=3))


def test_the_kernels_are_the_filter():
    ekf = LandmarkEkf(pose(0.3, -0.2, 0.5), np.diag([0.01, 0.02, 0.003]))
    size = POSE_DIM + 4
    states, covs, counts = np.zeros((1, size)), np.zeros((1, size, size)), np.zeros(1, np.int64)
    states[0, :POSE_DIM], covs[0, :POSE_DIM, :POSE_DIM] = ekf.x, ekf.P
    cov = np.array([[0.02, 0.005], [0.005, 0.01]])
    for landmark, position in zip([0, 1, 0], np.array([[2.0, 1.0], [3.0, -1.0], [1.7, 0.6]]), strict=True):
        ekf.Q = MOTION_COV
        ekf.predict(pose(0.3, 0.1, 0.2))
        move(states, covs, counts, pose(0.3, 0.1, 0.2), MOTION_COV)
        found = score(states, covs, counts, np.zeros((1, 2), np.bool_), position, cov, -7.0)
        assert found[0, counts[0]] == -7.0
        known = landmark < counts[0]
        states, covs, counts = branch(states, covs, counts, np.array([0]), np.array([landmark]), position, cov)
        if known:
            ekf.observe(position[None], cov[None], np.array([landmark]))
            innovation = np.linalg.slogdet(2.0 * math.pi * ekf.S)[1] + ekf.y @ np.linalg.solve(ekf.S, ekf.y)
            assert found[0, landmark] == pytest.approx(-0.5 * innovation, rel=1e-9)
        else:
            ekf.add_landmarks(position[None], cov)
        used = ekf.x.size
        np.testing.assert_allclose(states[0, :used], ekf.x, atol=1e-12)
        np.testing.assert_allclose(covs[0, :used, :used], ekf.P, atol=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_seen_at_once_is_never_one(seed):
    sightings, _ = zip(*drive(seed, steps=40), strict=True)
    for landmarks in most_likely(pose(), FIRST_COV, sightings):
        assert len(set(landmarks.tolist())) == len(landmarks)


def test_two_that_are_seen_at_once_are_two_however_near():
    """A fifth of a sigma apart, from a robot that stands."""
    looks = [Sighting(pose(), MOTION_COV, points([[3.0, 1.0], [3.0, 1.01]])) for _ in range(5)]
    for landmarks in most_likely(pose(), FIRST_COV, looks):
        assert sorted(landmarks.tolist()) == [0, 1]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_pairs_are_told_apart_without_identities(seed):
    sightings, _ = zip(*drive(seed), strict=True)
    graph, table = reassociate(LandmarkGraph(2.0), pose(), FIRST_COV, sightings, 100)
    estimate = graph.optimize(100)
    kept = table.confirmed(3)[estimate.landmarks]
    positions = estimate.positions_world[kept]
    assert len(positions) == len(LANDMARKS)
    nearest = np.hypot(*(LANDMARKS[:, None] - positions[None]).transpose(2, 0, 1))
    assert sorted(nearest.argmin(axis=1).tolist()) == list(range(len(LANDMARKS)))
    # Half the spacing of a pair: none is taken for its neighbour.
    assert nearest.min(axis=1).max() < 0.2


def likeliest(sightings, cov):
    """Most likely landmark of each observation, one a sighting, of all that there may be, by filters of their own."""

    def grow(ekf, landmarks, score, rest):
        if not rest:
            return score, landmarks
        found = []
        for landmark in range(len(ekf.landmarks) + 1):
            after, seen = LandmarkEkf(ekf.pose, ekf.pose_cov), rest[0].points_robot
            after.x, after.P, after.Q = ekf.x.copy(), ekf.P.copy(), rest[0].motion_cov
            if landmarks:
                after.predict(rest[0].motion)
            if landmark < len(ekf.landmarks):
                after.observe(seen.positions, seen.covs, np.array([landmark]))
                _, size = np.linalg.slogdet(2.0 * math.pi * after.S)
                own = -0.5 * (size + after.y @ np.linalg.solve(after.S, after.y))
            else:
                after.add_landmarks(seen.positions, seen.covs[0])
                own = math.log(MultiHypothesisRules().new_density)
            found.append(grow(after, [*landmarks, landmark], score + own, rest[1:]))
        return max(found)

    return grow(LandmarkEkf(pose(), cov), [], 0.0, list(sightings))[1]


@pytest.mark.parametrize("seed", range(12))
def test_of_few_observations_the_most_likely_of_all_associations_is_found(seed):
    """Six looks at three landmarks that are 2 sigma apart, by a robot that is unsure: what the first ones were of shows
    by the later ones only. All 203 ways are tried one by one."""
    rng = np.random.default_rng(seed)
    landmarks = np.array([[2.0, 0.0], [2.0, 1.0], [2.7, 0.5]])
    cov, motion_cov = np.diag([1e-6, 1e-6, 1e-8]), np.diag([0.3, 0.3, 0.05]) ** 2
    true, motion, sightings = pose(), pose(), []
    for step in range(6):
        noise = np.sqrt(np.diag(motion_cov)) * rng.normal(size=3)
        true = compose(true, motion + noise) if step else true
        seen = transform_inverse(true, landmarks[rng.integers(3)][None]) + rng.normal(0.0, 0.2, (1, 2))
        sightings.append(Sighting(motion, motion_cov, points(seen, 0.2)))
        motion = pose(0.1, 0.0, 0.1)
    found = [int(each[0]) for each in most_likely(pose(), cov, sightings)]
    assert found == likeliest(sightings, cov)
