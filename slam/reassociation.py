"""The graph of a whole run once more, by the associations that all of it makes the most likely."""

from collections.abc import Sequence

import numpy as np

from features.se2 import Array, Pose
from slam.graph import Observations
from slam.graph_journal import JournaledGraph
from slam.hypotheses import Sighting, most_likely
from slam.landmark import LandmarkTable


def reassociate(
    pose_world_robot: Pose, cov: Array, sightings: Sequence[Sighting], cauchy_scale: float
) -> tuple[JournaledGraph, LandmarkTable]:
    """Tell a graph what was seen, and of which landmarks by :func:`slam.hypotheses.most_likely`.

    Parameters
    ----------
    pose_world_robot, cov : first pose, shape (3,), and its covariance, shape (3, 3).
    sightings : from each key frame.
    cauchy_scale : of the graph.

    Returns
    -------
    graph, table : of the same landmarks; where they are, only the graph knows.
    """
    graph, table = JournaledGraph(cauchy_scale), LandmarkTable()
    for sighting, landmarks in zip(sightings, most_likely(pose_world_robot, cov, sightings), strict=True):
        points = sighting.points_robot
        observations = Observations(landmarks, points.positions, points.covs)
        graph.add_key_frame(pose_world_robot, sighting.motion, sighting.motion_cov, observations)
        graph.update()
        new = landmarks >= len(table)
        table.see(landmarks[~new], points, np.flatnonzero(~new), 0.0)
        table.add(points, np.flatnonzero(new), 0.0)
    return graph, table
