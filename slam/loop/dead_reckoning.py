"""Dead reckoning between key frames with its covariance, independent of any correction by the graph."""

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose, compose, compose_each, compose_jacobians, wrap_angle


class DeadReckoning:
    """Chain of the motions between key frames, in the frame of the first one.

    An error of one motion acts as if the world had moved a little about its origin. In these coordinates the errors of
    successive motions add, so the covariance of the motion between any two key frames is a difference of two sums
    (eq. M51).
    """

    def __init__(self) -> None:
        self._poses: Array = np.empty((0, 3))
        self._sums: Array = np.empty((0, 3, 3))

    def add(self, motion: Pose, motion_cov: Array) -> None:
        """Append a key frame: its pose in the frame of the one before, shape (3,), and the covariance of it, (3, 3).

        The motion of the first one is ignored.
        """
        here, total = np.zeros(3), np.zeros((3, 3))
        if len(self._poses):
            _, by_motion = compose_jacobians(self._poses[-1], motion)
            here = compose(self._poses[-1], motion)
            spread = _about_origin(here) @ by_motion
            total = self._sums[-1] + spread @ motion_cov @ spread.T
        self._poses = np.concatenate([self._poses, here[None]])
        self._sums = np.concatenate([self._sums, total[None]])

    def distances2(self, older: NDArray[np.int64], motions: Array, cov: Array) -> Array:
        """Squared Mahalanobis distances of motions up to the newest key frame from those by dead reckoning.

        Parameters
        ----------
        older : key frames that the motions start from, shape (h,).
        motions : poses of the newest key frame in their frames, shape (h, 3).
        cov : covariance of each motion, of the coordinates x, y, theta in the axes of the newest one, shape (3, 3).

        Returns
        -------
        shape (h,).
        """
        homes = self._poses[older]
        here: Array = self._poses[-1]
        total: Array = self._sums[-1]
        slip = compose_each(homes, motions) - here
        slip[:, 2] = wrap_angle(slip[:, 2])
        drift = np.linalg.inv(_about_origin(here))
        _, axes = compose_jacobians(here, motions[0])
        covs = drift @ (total - self._sums[older]) @ drift.T + axes @ cov @ axes.T
        return np.einsum("hi,hi->h", slip, np.linalg.solve(covs, slip[..., None])[..., 0])

    def drift(self, since: int) -> tuple[Pose, Array]:
        """Pose of the newest key frame, shape (3,), and the covariance of it since another one, (3, 3), same frame."""
        here: Array = self._poses[-1]
        back = np.linalg.inv(_about_origin(here))
        return here, back @ (self._sums[-1] - self._sums[since]) @ back.T


def _about_origin(pose: Pose) -> Array:
    """Jacobian of the motion about the origin with respect to the coordinates of a pose, shape (3, 3)."""
    x, y, _ = pose
    return np.array([[1.0, 0.0, y], [0.0, 1.0, -x], [0.0, 0.0, 1.0]])
