"""Values that other rooms exchange with the factor graph; nothing here needs GTSAM."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Corners seen from a key frame, as observations of landmarks.

    Parameters
    ----------
    landmarks : indices, shape (k,).
    positions_robot : shape (k, 2) [m].
    covs : shape (k, 2, 2) [m^2].
    """

    landmarks: NDArray[np.int64]
    positions_robot: Array
    covs: Array


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Two key frames that show the same place.

    Parameters
    ----------
    older, newer : indices of the key frames.
    motion : pose of the newer one in the frame of the older one, shape (3,).
    cov : covariance of its coordinates, shape (3, 3).
    """

    older: int
    newer: int
    motion: Pose
    cov: Array


@dataclass(frozen=True, slots=True, eq=False)
class GraphEstimate:
    """Result of a batch solve.

    Parameters
    ----------
    poses_world_robot : of the key frames, shape (n, 3).
    landmarks : indices of those that the graph holds, rising, shape (m,).
    positions_world, covs : of these landmarks, shapes (m, 2) [m] and (m, 2, 2) [m^2].
    converged : the solve ended before its limit of iterations.
    revoked : closures that the rest of the graph contradicts and that were left out.
    """

    poses_world_robot: Array
    landmarks: NDArray[np.int64]
    positions_world: Array
    covs: Array
    converged: bool
    revoked: tuple[Closure, ...] = ()
