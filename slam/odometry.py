"""What is expected of a motion before a scan is looked at, and how far it can be trusted."""

import math
from dataclasses import dataclass

import numpy as np

from features.se2 import Array, Pose, between, pose
from slam.drifting_pose import Anchor


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
        x, y, turn = increment.tolist()
        travel, turn = math.hypot(x, y), abs(turn)
        position = self.position_per_travel**2 * travel + self.position_per_turn**2 * turn
        heading = self.heading_per_travel**2 * travel + self.heading_per_turn**2 * turn
        return np.array([[position, 0.0, 0.0], [0.0, position, 0.0], [0.0, 0.0, heading]])


class WheelMotion:
    """Motion as the wheels report it.

    Parameters
    ----------
    model : of their errors.
    """

    def __init__(self, model: OdometryModel) -> None:
        self._model = model
        self._pose_odom_robot: Pose | None = None

    def step(self, stamp: float, pose_odom_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the record before and its covariance, shapes (3,) and (3, 3)."""
        before = pose_odom_robot if self._pose_odom_robot is None else self._pose_odom_robot
        self._pose_odom_robot = pose_odom_robot
        motion = between(before, pose_odom_robot)
        return motion, self._model.covariance(motion)

    def learn(self, stamp: float, since_scan: Anchor) -> None:
        """Wheels do not learn from scans."""


class ConstantVelocity:
    """Motion without any odometry: that between the last two scans goes on, and velocity changes as a random walk.

    Parameters
    ----------
    speed_change : sigma of the change of the velocity after one second, in x and y [m/s].
    turn_rate_change : sigma of the change of the turn rate after one second [rad/s].
    """

    def __init__(self, speed_change: float, turn_rate_change: float) -> None:
        self._density = np.diag([speed_change**2, speed_change**2, turn_rate_change**2])
        self._learned: float | None = None
        self._stamp = 0.0
        # The robot may be moving when the data begin.
        self._interval = 1.0
        self._velocity: Array = np.zeros(3)
        self._velocity_cov: Array = self._density

    def step(self, stamp: float, pose_odom_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the record before and its covariance, shapes (3,) and (3, 3); odometry is not looked at."""
        if self._learned is None:
            self._learned = self._stamp = stamp
        before, after = self._stamp - self._learned, stamp - self._learned
        self._stamp = stamp
        x, y, turn = (after - before) * self._velocity
        return pose(x, y, turn), self._cov(after) - self._cov(before)

    def _cov(self, elapsed: float) -> Array:
        """Covariance of the motion since the last scan, eq. M34."""
        return elapsed**2 * (self._velocity_cov + (self._interval + elapsed) / 3.0 * self._density)

    def learn(self, stamp: float, since_scan: Anchor) -> None:
        """Take the motion since the last scan, the latest one at ``stamp``, for the velocity."""
        interval = stamp - (stamp if self._learned is None else self._learned)
        self._learned = self._stamp = stamp
        if interval > 0.0:
            self._interval = interval
            self._velocity = since_scan.motion / interval
            self._velocity_cov = since_scan.motion_cov / interval**2
