"""Rebuilds the factor graph of a run with the associations that are most likely given all observations."""

import logging
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose
from slam.errors import DivergedError
from slam.filter.landmark_table import LandmarkTable
from slam.graph.back_end import BackEnd
from slam.graph.multi_hypothesis import Sighting, most_likely
from slam.graph.rules import MultiHypothesisRules
from slam.graph.values import GraphEstimate, Observations

logger = logging.getLogger(__name__)

Indices = NDArray[np.int64]


def reassociate(
    graph: BackEnd,
    pose_world_robot: Pose,
    cov: Array,
    sightings: Sequence[Sighting],
    max_iterations: int,
    rules: MultiHypothesisRules = MultiHypothesisRules(),  # noqa: B008, frozen
) -> tuple[BackEnd, LandmarkTable]:
    """Build the graph of a run anew, with the associations of :func:`slam.graph.multi_hypothesis.most_likely`.

    Parameters
    ----------
    graph : without key frames; it takes them.
    pose_world_robot, cov : first pose, shape (3,), and its covariance, shape (3, 3).
    sightings : from each key frame.
    max_iterations : limit of a solve.
    rules : how many hypotheses are kept for how long, and which landmarks are one.

    Returns
    -------
    graph, table : of the same landmarks; the table has no positions, the graph has.
    """
    observations = sum(len(sighting.points_robot) for sighting in sightings)
    logger.info("weighing which landmarks the %d observations are of, by all that was seen", observations)
    table = LandmarkTable()
    seen = most_likely(pose_world_robot, cov, sightings, rules)
    for sighting, landmarks in zip(sightings, seen, strict=True):
        points = sighting.points_robot
        seen_here = Observations(landmarks, points.positions, points.covs)
        graph.add_key_frame(pose_world_robot, sighting.motion, sighting.motion_cov, seen_here)
        graph.update()
        new = landmarks >= len(table)
        table.see(landmarks[~new], points, np.flatnonzero(~new), 0.0)
        table.add(points, np.flatnonzero(new), 0.0)
    apart = np.eye(len(table), dtype=np.bool_)
    variances = np.zeros(len(table))
    for sighting, landmarks in zip(sightings, seen, strict=True):
        apart[np.ix_(landmarks, landmarks)] = True
        variances[landmarks] += 0.5 * np.trace(sighting.points_robot.covs, axis1=1, axis2=2)
    variances /= table.observations
    try:
        while len(pairs := _one(graph, graph.optimize(max_iterations), apart, variances, rules.merge_gate)):
            for kept, other in pairs.tolist():
                graph.merge(kept, other)
                table.merge(kept, other)
                apart[kept] |= apart[other]
                apart[:, kept] |= apart[:, other]
    except DivergedError:
        # The solution that follows meets the same, and says so.
        pass
    return graph, table


def _one(graph: BackEnd, estimate: GraphEstimate, apart: NDArray[np.bool_], variances: Array, gate: float) -> Indices:
    """Pairs of landmarks to merge, nearest pairs first, each landmark once, the older one first, shape (k, 2), eq. M61.

    The covariance of a single observation is added to that of their difference: if noise has split one landmark into
    two, these are about one measurement error apart.
    """
    first, second = np.nonzero(np.triu(~apart[np.ix_(estimate.landmarks, estimate.landmarks)]))
    difference = estimate.positions_world[first] - estimate.positions_world[second]
    # The covariance of a difference is at most twice the sum of the two.
    alike = 0.5 * (variances[estimate.landmarks[first]] + variances[estimate.landmarks[second]])
    most = 2.0 * (estimate.covs[first] + estimate.covs[second]) + alike[:, None, None] * np.eye(2)
    least = np.einsum("ki,ki->k", difference, np.linalg.solve(most, difference[..., None])[..., 0])
    near = least <= gate
    pairs = np.stack([estimate.landmarks[first[near]], estimate.landmarks[second[near]]], axis=-1)
    distances2 = graph.distances2(estimate, pairs, alike[near])
    chosen: list[int] = []
    for pair in np.argsort(distances2, kind="stable").tolist():
        if distances2[pair] <= gate and not np.isin(pairs[pair], pairs[chosen]).any():
            chosen.append(pair)
    return pairs[chosen]
