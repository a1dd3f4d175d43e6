"""Multi-hypothesis data association of a whole run, one EKF per hypothesis (Reid 1979)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, Pose
from slam.filter.ekf import POSE_DIM
from slam.graph.multi_hypothesis_kernel import branch, move, score
from slam.graph.rules import MultiHypothesisRules

Indices = NDArray[np.int64]

ROOM = 16
"""Landmarks that there is room for at first."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """What was seen from a key frame.

    Parameters
    ----------
    motion, motion_cov : pose in the frame of the key frame before, shape (3,), and the covariance of its coordinates,
        shape (3, 3); ignored for the first one.
    points_robot : points without signature, robot frame.
    """

    motion: Pose
    motion_cov: Array
    points_robot: Corners


def most_likely(
    pose_world_robot: Pose,
    cov: Array,
    sightings: Sequence[Sighting],
    rules: MultiHypothesisRules = MultiHypothesisRules(),  # noqa: B008, frozen
) -> list[Indices]:
    """Landmark of each observation by the most likely of the hypotheses.

    Often only later observations decide which of two neighbouring landmarks was observed. Each
    observation is therefore taken for each landmark that it may be, and for a new one; of these hypotheses the likely
    ones go on (eq. M60). Two observations of one moment are two landmarks.

    Parameters
    ----------
    pose_world_robot, cov : first pose, shape (3,), and its covariance, shape (3, 3).
    sightings : one after the other.
    rules : how many hypotheses are kept for how long.

    Returns
    -------
    Indices, in the order of birth, of the observations of each sighting, shape (k,).
    """
    size = POSE_DIM + 2 * ROOM
    states, covs, counts = np.zeros((1, size)), np.zeros((1, size, size)), np.zeros(1, np.int64)
    states[0, :POSE_DIM], covs[0, :POSE_DIM, :POSE_DIM] = pose_world_robot, cov
    scores = np.zeros(1)
    latest = np.full((1, rules.memory), -1)
    new = math.log(rules.new_density)
    steps: list[tuple[Indices, Indices]] = []
    for index, sighting in enumerate(sightings):
        if index > 0:
            move(states, covs, counts, sighting.motion, sighting.motion_cov)
        taken = np.zeros((len(counts), (states.shape[1] - POSE_DIM) // 2), np.bool_)
        for position, position_cov in zip(sighting.points_robot.positions, sighting.points_robot.covs, strict=True):
            if counts.max() == taken.shape[1]:
                states, covs, taken = _more_room(states, covs, taken)
            seen = np.ascontiguousarray(position), np.ascontiguousarray(position_cov)
            likelihoods = scores[:, None] + score(states, covs, counts, taken, *seen, new)
            parents, landmarks = _best(likelihoods, counts, latest, rules.margin, rules.most_hypotheses)
            scores = likelihoods[parents, landmarks]
            scores -= scores[0]
            states, covs, counts = branch(states, covs, counts, parents, landmarks, *seen)
            latest = np.column_stack([landmarks, latest[parents, :-1]])
            taken = taken[parents]
            taken[np.arange(len(parents)), landmarks] = True
            steps.append((parents, landmarks))
    return _backtrack(steps, [len(sighting.points_robot) for sighting in sightings])


def _best(likelihoods: Array, counts: Indices, latest: Indices, margin: float, most: int) -> tuple[Indices, Indices]:
    """Parents and landmarks of the hypotheses that go on, the most likely first; of those alike the likelier one."""
    order = np.argsort(-likelihoods, axis=None, kind="stable")
    values = likelihoods.ravel()[order]
    order = order[values >= values[0] - margin]
    parents, landmarks = np.divmod(order, likelihoods.shape[1])
    alike = np.column_stack([np.maximum(counts[parents], landmarks + 1), landmarks, latest[parents, :-1]])
    first = np.sort(np.unique(alike, axis=0, return_index=True)[1])[:most]
    return parents[first], landmarks[first]


def _more_room(states: Array, covs: Array, taken: NDArray[np.bool_]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Twice the room for landmarks."""
    more = taken.shape[1]
    return (
        np.pad(states, ((0, 0), (0, 2 * more))),
        np.pad(covs, ((0, 0), (0, 2 * more), (0, 2 * more))),
        np.pad(taken, ((0, 0), (0, more))),
    )


def _backtrack(steps: list[tuple[Indices, Indices]], counts: list[int]) -> list[Indices]:
    """Landmarks along the ancestors of the hypothesis that is first at the end, by sighting."""
    landmarks = np.empty(len(steps), np.int64)
    hypothesis = 0
    for step in range(len(steps) - 1, -1, -1):
        parents, chosen = steps[step]
        landmarks[step] = chosen[hypothesis]
        hypothesis = int(parents[hypothesis])
    return np.split(landmarks, np.cumsum(counts)[:-1]) if counts else []
