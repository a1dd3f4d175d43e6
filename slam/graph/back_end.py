"""What a back-end promises: the one protocol that a solver of the factor graph has to fulfil."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose
from slam.graph.values import Closure, GraphEstimate, Observations


class BackEnd(Protocol):
    """Estimates key frames and landmarks from odometry, observations and closures.

    :class:`slam.graph.incremental.LandmarkGraph` is the one that comes with the project. A new back-end has no key
    frame; key frames are numbered from 0 in the order in which they are added.
    """

    def __len__(self) -> int:
        """Return the number of key frames."""
        ...

    @property
    def closures(self) -> Sequence[Closure]:
        """All closures that were added."""
        ...

    @property
    def poses_world_robot(self) -> Array:
        """Poses of the key frames as they are known by now, world frame, shape (n, 3) [m, m, rad]."""
        ...

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """Append a key frame.

        Parameters
        ----------
        pose_world_robot : pose of the first key frame, which defines the world frame; ignored for all others.
        motion, motion_cov : pose in the frame of the key frame before, shape (3,), and the covariance of its
            coordinates, shape (3, 3); ignored for the first one.
        observations : landmarks seen from it.
        """
        ...

    def add_closure(self, closure: Closure) -> None:
        """Append a loop closure; :meth:`optimize` may revoke it."""
        ...

    def merge(self, kept: int, other: int) -> None:
        """Merge two landmarks: earlier and later observations of ``other`` become observations of ``kept``."""
        ...

    def update(self) -> None:
        """Bring :attr:`poses_world_robot` up to date with everything that was added."""
        ...

    def newest_cov(self) -> Array | None:
        """Covariance of the coordinates of the newest key frame, world frame, shape (3, 3); None where unknown."""
        ...

    def optimize(self, max_iterations: int) -> GraphEstimate:
        """Solve for all key frames and landmarks at once, without the closures that the rest contradicts.

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        ...

    def pose_covs(self, estimate: GraphEstimate, key_frames: NDArray[np.int64]) -> Array:
        """Marginal covariances of key frames at a solution, each in the key frame's own frame, shape (k, 3, 3).

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        ...

    def distances2(self, estimate: GraphEstimate, pairs: NDArray[np.int64], variances: Array) -> Array:
        """Squared Mahalanobis distances between pairs of landmarks at a solution, shape (k,).

        Parameters
        ----------
        estimate : of :meth:`optimize`.
        pairs : landmarks of it, shape (k, 2).
        variances : added in x and y to the covariance of each difference, shape (k,) [m^2].

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        ...

    def unsolved(self) -> GraphEstimate:
        """Return the estimate before any :meth:`optimize`, for where that one fails; covariances are NaN."""
        ...
