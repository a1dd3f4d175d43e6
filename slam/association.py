"""Which landmark an observed corner is: gated nearest neighbour with the corner's signature."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, wrap_angle
from slam.ekf import POSE_DIM, LandmarkEkf, corner_jacobian_blocks, predict_corners
from slam.landmark import LandmarkTable

Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """Corners by what became of them; a corner in neither is ambiguous and left out.

    Parameters
    ----------
    corners, landmarks : matched pairs, shape (m,) each.
    new : corners that no landmark explains, shape (b,).
    """

    corners: Indices
    landmarks: Indices
    new: Indices


@dataclass(frozen=True, slots=True)
class Gates:
    """Limits of the association.

    Parameters
    ----------
    match, birth : squared Mahalanobis distances, 2 degrees of freedom: up to the first a corner may be the landmark,
        beyond the second it is none of those known.
    birth_distance : nearest landmark of the same kind to a new one [m].
    opening, orientation : differences of signature that may belong together [rad].
    """

    match: float
    birth: float
    birth_distance: float
    opening: float
    orientation: float


def associate(corners_robot: Corners, ekf: LandmarkEkf, table: LandmarkTable, gates: Gates) -> Association:
    """Match corners, robot frame, to the filter's landmarks, nearest pairs first, each landmark at most once.

    A pair is admitted by the innovation covariance of the two (eq. M18), the same kind and a similar signature.
    """
    count = len(corners_robot)
    none = np.empty(0, np.int64)
    if count == 0 or len(table) == 0:
        return Association(none, none, np.arange(count))

    innovations, covs = _innovations(corners_robot, ekf)
    distances2 = _mahalanobis2(innovations, covs)
    alike = _alike(corners_robot, table, ekf.x[2], gates)
    admitted = np.where(alike, distances2, np.inf)

    corners: list[int] = []
    landmarks: list[int] = []
    rows, columns = np.nonzero(admitted <= gates.match)
    for pair in np.argsort(admitted[rows, columns], kind="stable"):
        corner, landmark = int(rows[pair]), int(columns[pair])
        if corner not in corners and landmark not in landmarks:
            corners.append(corner)
            landmarks.append(landmark)

    same_kind = corners_robot.convex[:, None] == table.convex[None, :]
    near = same_kind & (np.hypot(innovations[..., 0], innovations[..., 1]) < gates.birth_distance)
    explained = (near | (admitted <= gates.birth)).any(axis=1)
    explained[corners] = True
    return Association(np.array(corners, np.int64), np.array(landmarks, np.int64), np.flatnonzero(~explained))


def _innovations(corners_robot: Corners, ekf: LandmarkEkf) -> tuple[Array, Array]:
    """Innovation of every corner against every landmark, (k, n, 2), and its covariance, (k, n, 2, 2)."""
    landmarks = np.arange(len(ekf.landmarks))
    predicted = predict_corners(ekf.x, landmarks)
    by_pose, by_landmark = corner_jacobian_blocks(ekf.x, landmarks)
    cov_pose = ekf.P[:POSE_DIM, :POSE_DIM]
    cov_cross = ekf.P[:POSE_DIM, POSE_DIM:].reshape(POSE_DIM, -1, 2).transpose(1, 0, 2)
    mixed = by_pose @ cov_cross @ by_landmark.T
    cov_predicted = (
        by_pose @ cov_pose @ by_pose.transpose(0, 2, 1)
        + mixed
        + mixed.transpose(0, 2, 1)
        + by_landmark @ ekf.landmark_covs @ by_landmark.T
    )
    return corners_robot.positions[:, None, :] - predicted[None], corners_robot.covs[:, None] + cov_predicted[None]


def _mahalanobis2(innovations: Array, covs: Array) -> Array:
    """Squared Mahalanobis distances by the closed form of a symmetric 2x2 system."""
    a, b, c = covs[..., 0, 0], covs[..., 0, 1], covs[..., 1, 1]
    u, v = innovations[..., 0], innovations[..., 1]
    return (c * u * u - 2.0 * b * u * v + a * v * v) / (a * c - b * b)


def _alike(corners_robot: Corners, table: LandmarkTable, heading: float, gates: Gates) -> NDArray[np.bool_]:
    opening = corners_robot.opening_angles[:, None] - table.opening_angles[None, :]
    orientation = wrap_angle(corners_robot.orientations[:, None] + heading - table.orientations[None, :])
    return (
        (corners_robot.convex[:, None] == table.convex[None, :])
        & (np.abs(opening) < gates.opening)
        & (np.abs(orientation) < gates.orientation)
    )
