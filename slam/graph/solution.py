"""The batch solution of the graph of a run, or its incremental estimate if there is no unique solution."""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from slam.errors import DivergedError
from slam.filter.landmark_table import LandmarkTable
from slam.graph.back_end import BackEnd
from slam.graph.values import GraphEstimate

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A graph, the landmarks in it, and where its batch solve puts all of them.

    Parameters
    ----------
    graph, table : of the same landmarks.
    estimate : poses and landmarks.
    """

    graph: BackEnd
    table: LandmarkTable
    estimate: GraphEstimate

    def pose_covs(self, key_frames: NDArray[np.int64]) -> Array:
        """Marginal covariances of key frames; see :meth:`slam.graph.back_end.BackEnd.pose_covs`."""
        return self.graph.pose_covs(self.estimate, key_frames)


def solve(graph: BackEnd, table: LandmarkTable, max_iterations: int) -> Solution:
    """Solve a graph; if it has no unique solution, log a warning and return the incremental estimate."""
    try:
        return Solution(graph, table, graph.optimize(max_iterations))
    except DivergedError as error:
        logger.warning("%s: the result is what was known on the way", error)
        return Solution(graph, table, graph.unsolved())
