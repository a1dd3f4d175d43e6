# pyright: reportConstantRedefinition=false
# Matrices have the capital letters of filterpy.
"""EKF-SLAM over a robot pose and point landmarks, on filterpy's extended Kalman filter.

The state is ``[x, y, theta, x_1, y_1, x_2, y_2, ...]``, world frame. The steps of filterpy are dense, cubic in the
number of landmarks; here they work on the few rows that a motion or an observation touches. Interface, names and
bookkeeping are those of filterpy, so that whatever works with its filters works with this one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Concatenate, TypeAlias

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter  # pyright: ignore[reportMissingTypeStubs]  # filterpy is untyped
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array

from features.se2 import Array, Pose, compose, rotation, transform_inverse, wrap_angle
from features.se2_kernels import compound
from slam.errors import DivergedError

POSE_DIM = 3

Jacobian: TypeAlias = "CornerJacobian | csr_array | Array"
"""Derivative of a measurement by the state, shape (m, dim_x)."""


class LandmarkEkf(ExtendedKalmanFilter):
    """Extended Kalman filter whose motion touches the pose only and whose observation Jacobians are sparse.

    It is used as filterpy's :class:`ExtendedKalmanFilter`: ``predict``, ``predict_x``, ``update``, ``predict_update``,
    ``likelihood``, ``mahalanobis``, ``Saver``. The control ``u`` is a motion, a pose in the frame of the robot before
    it; ``Q`` is the covariance of its coordinates, shape (3, 3). ``F`` and ``B`` play no part.

    Parameters
    ----------
    pose_world_robot : first pose, shape (3,) [m, m, rad].
    cov : its covariance, shape (3, 3).
    """

    x: Array
    P: Array
    dim_z: int

    def __init__(self, pose_world_robot: Pose, cov: Array) -> None:
        super().__init__(dim_x=POSE_DIM, dim_z=2)
        self.x = np.array(pose_world_robot, dtype=np.float64)
        self.P = np.array(cov, dtype=np.float64)
        self.Q = np.zeros((POSE_DIM, POSE_DIM))
        self._save_prior()
        self._save_posterior()

    @property
    def pose(self) -> Pose:
        """Pose of the robot, world frame, shape (3,)."""
        return self.x[:POSE_DIM].copy()

    @property
    def pose_cov(self) -> Array:
        """Covariance of the pose, shape (3, 3)."""
        return self.P[:POSE_DIM, :POSE_DIM].copy()

    @property
    def landmarks(self) -> Array:
        """Landmarks, world frame, shape (n, 2) [m]."""
        return self.x[POSE_DIM:].reshape(-1, 2)

    @property
    def landmark_covs(self) -> Array:
        """Covariance of each landmark, shape (n, 2, 2) [m^2]."""
        blocks = POSE_DIM + 2 * np.arange(len(self.landmarks))[:, None] + np.arange(2)
        return self.P[blocks[:, :, None], blocks[:, None, :]]

    def predict_x(self, u: Pose | int = 0) -> None:
        """Move the robot by ``u`` in the state alone; the covariance stays as it is."""
        self.x = np.concatenate([compose(self.x[:POSE_DIM], _motion(u)), self.x[POSE_DIM:]])

    def predict(self, u: Pose | int = 0) -> None:
        """Move the robot by ``u``, shape (3,), with covariance ``Q``; without ``u`` it stands, and ``Q`` is added.

        Landmarks do not move, so three rows and columns of P change (eq. M13).

        Raises
        ------
        DivergedError
            The moved pose or its covariance is not finite.
        """
        cross = self.P[:POSE_DIM, POSE_DIM:].copy()
        pose, cov, finite = compound(self.x[:POSE_DIM], self.pose_cov, cross[None], _motion(u), self.Q)
        if not finite:
            raise DivergedError("the pose or its covariance is no longer finite: look at the odometry and the mounting")
        self.x, self.P = self.x.copy(), self.P.copy()
        self.x[:POSE_DIM] = pose
        self.P[:POSE_DIM, :POSE_DIM] = cov
        self.P[:POSE_DIM, POSE_DIM:] = cross
        self.P[POSE_DIM:, :POSE_DIM] = cross.T
        self._save_prior()

    def update(
        self,
        z: Array | None,
        HJacobian: Callable[Concatenate[Array, ...], Jacobian],
        Hx: Callable[Concatenate[Array, ...], Array],
        R: Array | float | None = None,
        args: object = (),
        hx_args: object = (),
        residual: Callable[[Array, Array], Array] = np.subtract,
    ) -> None:
        """Update with a measurement as filterpy does; the Jacobian may be sparse. Nothing changes where ``z`` is None.

        Raises
        ------
        DivergedError
            The innovation covariance is not positive definite.
        """
        if z is None:
            self.z = np.full((self.dim_z, 1), None)
            self._save_posterior()
            return
        noise = self.R if R is None else np.asarray(R)
        if noise.ndim == 0:
            noise = noise * np.eye(self.dim_z)
        H = HJacobian(self.x, *_tuple(args))
        cross = (H @ self.P).T
        self.S = H @ cross + noise
        try:
            factor = cho_factor(self.S, lower=True)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise DivergedError(f"the innovation covariance is not positive definite: {error}") from None
        self.SI = cho_solve(factor, np.eye(len(self.S)))
        self.K = cho_solve(factor, cross.T).T
        self.y = residual(z, Hx(self.x, *_tuple(hx_args)))
        x = self.x + self.K @ self.y
        x[2] = wrap_angle(x[2])
        P = self.P - self.K @ cross.T
        self.x, self.P = x, 0.5 * (P + P.T)
        self.z = z.copy()
        self._log_likelihood = self._likelihood = self._mahalanobis = None
        self._save_posterior()

    def predict_update(
        self,
        z: Array | None,
        HJacobian: Callable[Concatenate[Array, ...], Jacobian],
        Hx: Callable[Concatenate[Array, ...], Array],
        args: object = (),
        hx_args: object = (),
        u: Pose | int = 0,
    ) -> None:
        """Predict by ``u`` and update with ``z``, see :meth:`predict` and :meth:`update`."""
        self.predict(u)
        self.update(z, HJacobian, Hx, args=args, hx_args=hx_args)

    def observe(self, positions_robot: Array, covs: Array, landmarks: NDArray[np.int64]) -> None:
        """Update with corners, robot frame, shapes (k, 2) and (k, 2, 2), of known landmarks, indices of shape (k,)."""
        self.update(
            positions_robot.ravel(),
            lambda x: corner_jacobian(x, landmarks),
            lambda x: predict_corners(x, landmarks).ravel(),
            R=block_diagonal(covs),
        )

    def add_landmarks(self, positions_robot: Array, cov: Array) -> None:
        """Append landmarks at ``positions_robot``, shape (k, 2), robot frame, of joint covariance (2 k, 2 k).

        A new landmark is correlated with the pose it was seen from and, through it, with every other (eq. M16-M17).
        """
        turn = rotation(self.x[2])
        arms = positions_robot @ turn.T
        by_pose = np.zeros((2 * len(arms), POSE_DIM))
        by_pose[0::2, 0] = by_pose[1::2, 1] = 1.0
        by_pose[0::2, 2] = -arms[:, 1]
        by_pose[1::2, 2] = arms[:, 0]
        cross = by_pose @ self.P[:POSE_DIM]
        turns = np.kron(np.eye(len(arms)), turn)
        own = cross[:, :POSE_DIM] @ by_pose.T + turns @ cov @ turns.T
        self.x = np.concatenate([self.x, (self.x[:2] + arms).ravel()])
        self.P = np.block([[self.P, cross.T], [cross, 0.5 * (own + own.T)]])
        self.dim_x = self.x.size
        self._save_posterior()

    def positions_robot(self) -> Array:
        """Landmarks in the robot frame, shape (n, 2) [m]."""
        return predict_corners(self.x, np.arange(len(self.landmarks)))

    def relative(self, landmarks: NDArray[np.int64] | None = None) -> tuple[Array, Array]:
        """Landmarks, all by default, in the robot frame, shape (k, 2), and their joint covariance, shape (2 k, 2 k)."""
        if landmarks is None:
            landmarks = np.arange(len(self.landmarks))
        H = corner_jacobian(self.x, landmarks)
        return predict_corners(self.x, landmarks), np.asarray(H @ (H @ self.P).T)

    def rebase(self, pose_world_robot: Pose, cov: Array) -> None:
        """Replace pose and covariance (3, 3); the landmarks relative to the robot stay as they are (eq. M41)."""
        positions_robot, relative_cov = self.relative()
        self.x = np.array(pose_world_robot, dtype=np.float64)
        self.P = np.array(cov, dtype=np.float64)
        self.add_landmarks(positions_robot, relative_cov)

    def forget(self, landmarks: NDArray[np.int64]) -> None:
        """Marginalise landmarks out: delete their rows and columns; the rest of the state is unchanged."""
        kept = np.ones(self.x.size, np.bool_)
        kept[(POSE_DIM + 2 * landmarks[:, None] + np.arange(2)).ravel()] = False
        self.x, self.P = self.x[kept], self.P[np.ix_(kept, kept)]
        self.dim_x = self.x.size
        self._save_posterior()

    def _save_prior(self) -> None:
        self.x_prior, self.P_prior = self.x, self.P

    def _save_posterior(self) -> None:
        self.x_post, self.P_post = self.x, self.P


def _motion(u: Pose | int) -> Pose:
    """Motion that a control means: filterpy's default of 0 is none."""
    return np.zeros(POSE_DIM) if np.isscalar(u) and u == 0 else np.asarray(u, np.float64)


def _tuple(arguments: object) -> tuple[object, ...]:
    """Arguments of a function as filterpy takes them: a tuple, or a single one by itself."""
    return arguments if isinstance(arguments, tuple) else (arguments,)  # pyright: ignore[reportUnknownVariableType]  # a tuple of anything


def block_diagonal(blocks: Array) -> Array:
    """Matrix of 2x2 blocks on its diagonal, shape (2 k, 2 k), of blocks (k, 2, 2)."""
    count = len(blocks)
    matrix = np.zeros((count, 2, count, 2))
    own = np.arange(count)
    matrix[own, :, own] = blocks
    return matrix.reshape(2 * count, 2 * count)


def predict_corners(x: Array, landmarks: NDArray[np.int64]) -> Array:
    """Positions of landmarks in the robot frame, shape (k, 2) [m], eq. M14."""
    return transform_inverse(x[:POSE_DIM], x[POSE_DIM:].reshape(-1, 2)[landmarks])


@dataclass(frozen=True, slots=True, eq=False)
class CornerJacobian:
    """Derivative of :func:`predict_corners` by the state, of which only the entries that are not zero are kept.

    Parameters
    ----------
    by_pose, by_landmark : its blocks, shapes (k, 2, 3) and (2, 2).
    landmarks : indices, shape (k,).
    dim_x : dimension of the state.
    """

    by_pose: Array
    by_landmark: Array
    landmarks: NDArray[np.int64]
    dim_x: int

    def __matmul__(self, matrix: Array) -> Array:
        """Product with a dense matrix, shape (dim_x, m), on the rows that it touches."""
        columns = matrix.shape[1]
        rows = matrix[POSE_DIM:].reshape((self.dim_x - POSE_DIM) // 2, 2, columns)[self.landmarks]
        return (self.by_pose @ matrix[:POSE_DIM] + self.by_landmark @ rows).reshape(2 * len(rows), columns)

    def toarray(self) -> Array:
        """All entries, shape (2 k, dim_x)."""
        return self @ np.eye(self.dim_x)


def corner_jacobian(x: Array, landmarks: NDArray[np.int64]) -> CornerJacobian:
    """Differentiate :func:`predict_corners` by the state, shape (2 k, dim_x), five entries a row, eq. M15."""
    return CornerJacobian(*corner_jacobian_blocks(x, landmarks), landmarks, x.size)


def corner_jacobian_blocks(x: Array, landmarks: NDArray[np.int64]) -> tuple[Array, Array]:
    """Blocks of :func:`corner_jacobian`: by the pose, shape (k, 2, 3), and by each landmark, shape (2, 2)."""
    turn_back = rotation(x[2]).T
    corners = predict_corners(x, landmarks)
    by_pose = np.empty((len(landmarks), 2, 3))
    by_pose[:, :, :2] = -turn_back
    by_pose[:, 0, 2] = corners[:, 1]
    by_pose[:, 1, 2] = -corners[:, 0]
    return by_pose, turn_back
