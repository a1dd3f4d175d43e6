"""Which landmark an observed corner is: gates, signature, and nearest neighbour or joint compatibility."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from features.feature import Corners
from features.se2 import Array
from features.signature import Kind, Signatures, alike
from slam.filter.ekf import POSE_DIM, LandmarkEkf, corner_jacobian_blocks, predict_corners
from slam.filter.joint_compatibility import joint_compatibility
from slam.filter.rules import FilterRules

Indices = NDArray[np.int64]

Method = Literal["joint", "nearest"]
"""Joint compatibility branch and bound, or gated nearest neighbour."""


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """Data association of the corners of a scan; corners that are neither matched nor new are discarded.

    Parameters
    ----------
    corners, landmarks : matched pairs, shape (m,) each.
    new : corners that no landmark explains, shape (b,).
    nis : squared Mahalanobis distance of the matched innovations together, 2 m degrees of freedom.
    ambiguous : how many were left out although the gate admits a landmark; the others that were left out are too near
        to one to be new.
    """

    corners: Indices
    landmarks: Indices
    new: Indices
    nis: float = 0.0
    ambiguous: int = 0


@dataclass(slots=True)
class ObservationCounts:
    """Counts of the associations of all corners of a run.

    Parameters
    ----------
    matched, new : matched to a known landmark; initialised as a new one.
    ambiguous : left out as the gate admitted a landmark that went to another corner, or did not fit the others.
    gated_out : left out as no gate admitted a landmark, but one was too near for the corner to be new.
    """

    matched: int = 0
    new: int = 0
    ambiguous: int = 0
    gated_out: int = 0

    def add(self, corners: int, association: Association) -> None:
        """Count one scan of so many corners."""
        self.matched += len(association.corners)
        self.new += len(association.new)
        self.ambiguous += association.ambiguous
        self.gated_out += corners - len(association.corners) - len(association.new) - association.ambiguous


class Gates:
    """Limits of the association.

    Parameters
    ----------
    method : how pairs are chosen among those that the gates admit.
    match_probability : chi-square probability of the association gate.
    birth_probability : chi-square probability of the gate outside of which a corner is a new landmark.
    birth_distance : least distance of a new landmark from any other of the same kind [m].
    opening, orientation : largest differences of opening angle and orientation in a matched pair [rad].
    most_nodes : of the search tree of the joint compatibility.
    """

    def __init__(
        self,
        method: Method,
        match_probability: float,
        birth_probability: float,
        birth_distance: float,
        opening: float,
        orientation: float,
        most_nodes: int = FilterRules().most_nodes,
    ) -> None:
        self.method: Method = method
        self.most_nodes = most_nodes
        self._match_probability = match_probability
        self._joint: Array = np.empty(0)
        self.match = float(self.joint(1)[1])
        self.birth = float(chi2.ppf(birth_probability, 2))
        self.birth_distance = birth_distance
        self.opening = opening
        self.orientation = orientation

    def joint(self, most_pairs: int) -> Array:
        """Limits of the squared Mahalanobis distance of 0, 1, ... pairs together, for so many pairs or more."""
        if len(self._joint) <= most_pairs:
            dofs = np.maximum(2 * np.arange(2 * most_pairs + 1), 1)
            self._joint = np.asarray(chi2.ppf(self._match_probability, dofs), np.float64)
        return self._joint


class Associator(Protocol):
    """Matches the corners of a scan to landmarks; :func:`associate` is the one that comes with the project."""

    def __call__(self, corners_robot: Corners, ekf: LandmarkEkf, signatures: Signatures, gates: Gates) -> Association:
        """Match corners, robot frame, to the landmarks of the filter, each landmark at most once.

        Parameters
        ----------
        corners_robot : of one scan.
        ekf : the filter, moved to where the scan was taken.
        signatures : of its landmarks, in the order of its state, world frame.
        gates : limits, as configured.
        """
        ...


def associate(corners_robot: Corners, ekf: LandmarkEkf, signatures: Signatures, gates: Gates) -> Association:
    """Match corners, robot frame, to the filter's landmarks, each landmark at most once.

    A pair is admitted by its innovation covariance (eq. M18) and its signatures.

    Parameters
    ----------
    corners_robot, ekf : the corners and the filter.
    signatures : of the landmarks in the order of the filter's state, world frame, shape (n,).
    gates : limits of what is admitted.
    """
    count = len(corners_robot)
    none = np.empty(0, np.int64)
    if count == 0 or len(signatures) == 0:
        return Association(none, none, np.arange(count))

    innovations, covs = _innovations(corners_robot, ekf)
    distances2 = _mahalanobis2(innovations, covs)
    seen = corners_robot.signatures.turned(ekf.x[2])[:, None]
    admitted = np.where(alike(seen, signatures, gates.opening, gates.orientation), distances2, np.inf)
    rows, columns = np.nonzero(admitted <= gates.match)
    if gates.method == "joint":
        cov = _joint_cov(corners_robot, ekf, rows, columns)
        chosen, nis = joint_compatibility(
            rows, columns, innovations[rows, columns], cov, gates.joint(count), gates.most_nodes
        )
    else:
        chosen = _nearest(rows, columns, admitted[rows, columns])
        nis = _joint_distance2(
            innovations[rows, columns][chosen], _joint_cov(corners_robot, ekf, rows[chosen], columns[chosen])
        )
    corners, landmarks = rows[chosen], columns[chosen]

    near = (seen.kinds == signatures.kinds) & (
        np.hypot(innovations[..., 0], innovations[..., 1]) < gates.birth_distance
    )
    explaining = near | (admitted <= gates.birth)
    # A matched landmark does not explain another point of the same scan: two points seen at once are two landmarks.
    explaining[np.ix_(corners_robot.kinds == Kind.POINT, landmarks)] = False
    explained = explaining.any(axis=1)
    explained[corners] = True
    new = np.flatnonzero(~explained)
    ambiguous = len(set(rows.tolist()) - set(corners.tolist()) - set(new.tolist()))
    return Association(corners, landmarks, new, nis, ambiguous)


def associate_identified(
    corners_robot: Corners, identities: Indices, ekf: LandmarkEkf, known: Indices, gate: float
) -> tuple[Association, Array]:
    """Match observations, robot frame, to landmarks by their identities; of equal identities only the first counts.

    Parameters
    ----------
    corners_robot, identities : of each observation, shape (k,).
    ekf, known : the filter, and the identity of each of its landmarks, shape (n,).
    gate : squared Mahalanobis distance, 2 degrees of freedom, beyond which the covariance is enlarged.

    Returns
    -------
    association : of all observations, whatever their distances; its NIS is that with the enlarged covariances.
    covs : of the matched observations, shape (m, 2, 2) [m^2]; enlarged where they lie beyond the gate, by so much that
        one misread identity moves the filter little.
    """
    first = np.sort(np.unique(identities, return_index=True)[1])
    equal = identities[first, None] == known[None, :]
    matched = equal.any(axis=1)
    corners, landmarks = first[matched], np.nonzero(equal)[1]
    if not corners.size:
        return Association(corners, landmarks, first), np.empty((0, 2, 2))
    innovations = corners_robot.positions[corners] - predict_corners(ekf.x, landmarks)
    cov = _joint_cov(corners_robot, ekf, corners, landmarks)
    blocks, own = cov.reshape(len(corners), 2, len(corners), 2), np.arange(len(corners))
    inflation = np.maximum(_mahalanobis2(innovations, blocks[own, :, own]) / gate, 1.0)[:, None, None]
    covs = corners_robot.covs[corners]
    blocks[own, :, own] += (inflation - 1.0) * covs
    association = Association(corners, landmarks, first[~matched], _joint_distance2(innovations, cov))
    return association, inflation * covs


def _nearest(corners: Indices, landmarks: Indices, distances2: Array) -> Indices:
    """Candidates, nearest pairs first, each corner and landmark at most once."""
    chosen: list[int] = []
    for pair in np.argsort(distances2, kind="stable"):
        if corners[pair] not in corners[chosen] and landmarks[pair] not in landmarks[chosen]:
            chosen.append(int(pair))
    return np.array(chosen, np.int64)


def _joint_distance2(innovations: Array, cov: Array) -> float:
    h = innovations.ravel()
    return float(h @ np.linalg.solve(cov, h)) if h.size else 0.0


def _joint_cov(corners_robot: Corners, ekf: LandmarkEkf, corners: Indices, landmarks: Indices) -> Array:
    """Covariance of the innovations of several pairs together, shape (2 m, 2 m) [m^2].

    The block of two pairs of the same corner lacks the noise of the corner, which both share: no hypothesis has both.
    """
    m = len(corners)
    _, cov = ekf.relative(landmarks)
    own = np.arange(m)
    cov.reshape(m, 2, m, 2)[own, :, own] += corners_robot.covs[corners]
    return cov


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
