"""Wheel odometry: motion between two records and how far it can be trusted."""

from dataclasses import dataclass

import numpy as np

from features.se2 import Array, Pose, between, compose, compose_jacobians, pose


@dataclass(frozen=True, slots=True)
class OdometryModel:
    """Random walk of an odometry increment; variances grow in proportion to travel and turn, so steps can be split.

    Parameters
    ----------
    position_per_travel : sigma of position after one metre [m].
    position_per_turn : sigma of position after a turn of one radian [m].
    heading_per_travel : sigma of heading after one metre [rad].
    heading_per_turn : sigma of heading after a turn of one radian [rad].
    """

    position_per_travel: float
    position_per_turn: float
    heading_per_travel: float
    heading_per_turn: float

    def covariance(self, increment: Pose) -> Array:
        """Covariance, shape (3, 3), of the coordinates of an increment, eq. M12."""
        travel = float(np.hypot(increment[0], increment[1]))
        turn = abs(float(increment[2]))
        position = self.position_per_travel**2 * travel + self.position_per_turn**2 * turn
        heading = self.heading_per_travel**2 * travel + self.heading_per_turn**2 * turn
        return np.diag([position, position, heading])


class OdometryIncrement:
    """Motion since the last reset, composed of small steps, with its covariance.

    The steps' covariances are carried through :func:`features.se2.compose`, so that a heading error early on becomes a
    lateral error later (eq. M11).
    """

    def __init__(self, model: OdometryModel) -> None:
        self._model = model
        self.reset()

    def reset(self) -> None:
        """Start again from no motion."""
        self.motion: Pose = pose()
        self.cov: Array = np.zeros((3, 3))

    def add(self, pose_odom_before: Pose, pose_odom_after: Pose) -> None:
        """Append the motion between two odometry poses."""
        step = between(pose_odom_before, pose_odom_after)
        by_motion, by_step = compose_jacobians(self.motion, step)
        self.cov = by_motion @ self.cov @ by_motion.T + by_step @ self._model.covariance(step) @ by_step.T
        self.motion = compose(self.motion, step)

    @property
    def travel(self) -> float:
        """Distance between start and end [m]."""
        return float(np.hypot(self.motion[0], self.motion[1]))

    @property
    def turn(self) -> float:
        """Turn between start and end, 0 to pi [rad]."""
        return abs(float(self.motion[2]))
