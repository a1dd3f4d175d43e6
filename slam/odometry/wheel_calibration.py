"""Calibration of the systematic errors of the wheels by the motion between registered scans."""

from dataclasses import dataclass

import numpy as np

from features.se2 import Array, Pose, wrap_angle
from slam.odometry.cloned_pose import ClonedPose, PoseClone
from slam.odometry.rules import CalibrationRules


@dataclass(frozen=True, slots=True)
class Calibration:
    """What has to be added to a motion that wheels report.

    Parameters
    ----------
    travel : share of its translation.
    turn : share of its rotation.
    drift : rotation by translation, to the left [rad/m].
    """

    travel: float = 0.0
    turn: float = 0.0
    drift: float = 0.0


class WheelCalibration:
    """Learns the systematic errors of wheels, stretch by stretch (eq. M62, M63).

    Parameters
    ----------
    rules : what is known before, how long a stretch is and what is left out.
    """

    def __init__(self, rules: CalibrationRules = CalibrationRules()) -> None:  # noqa: B008, frozen
        self._rules = rules
        self._slip_gate = rules.slip_gate
        self._state = np.zeros(3)
        self._information: Array = np.asarray(np.linalg.inv(rules.first_cov), np.float64)
        self._wheels = ClonedPose(np.zeros(3))
        self._since = self._wheels.clone()

    @property
    def calibration(self) -> Calibration:
        """What was learned so far."""
        return Calibration(*self._state.tolist())

    @property
    def cov(self) -> Array:
        """Covariance of travel, turn and drift, shape (3, 3); it holds for wheels whose chance errors are as stated."""
        return np.asarray(np.linalg.inv(self._information), np.float64)

    def corrected(self, motion: Pose) -> Pose:
        """Correct a reported motion, shape (3,), for the systematic errors estimated so far."""
        left_out: Pose = _jacobian(motion) @ self._state
        return motion + left_out

    def move(self, motion: Pose, cov: Array) -> None:
        """Append a motion, corrected, shape (3,), with its covariance, to the stretch that is compared next."""
        self._wheels.move(motion, cov)

    def doubt(self, motion: Pose) -> Array:
        """Covariance of a motion, shape (3,), or of a velocity, that comes from the doubt of the calibration."""
        jacobian = _jacobian(motion)
        return jacobian @ self.cov @ jacobian.T

    def learn(self, since: PoseClone) -> bool:
        """Compare the motion since the last comparison with what the wheels say of it; False where it was too short."""
        if since.travel < self._rules.stretch_travel and since.turn < self._rules.stretch_turn:
            return False
        expected, cov = self._since.motion, self._since.motion_cov
        self._since.reset()
        if not (cov.diagonal() > 0.0).all():
            return True
        root = np.linalg.cholesky(cov)
        change = since.motion - expected
        change[2] = wrap_angle(float(change[2]))
        change = np.linalg.solve(root, change)
        if change @ change > self._slip_gate:
            return True
        # By the motion that the scans show: errors of the wheels in the regressor would make the calibration small.
        jacobian = np.linalg.solve(root, _jacobian(since.motion))
        gain, axes = np.linalg.eigh(np.eye(3) - np.linalg.solve(root, np.linalg.solve(root, since.motion_cov).T))
        shown = gain > self._rules.least_gain
        along = axes[:, shown].T @ jacobian
        self._information = self._information + along.T * gain[shown] @ along
        self._state = self._state + np.linalg.solve(self._information, along.T @ (axes[:, shown].T @ change))
        return True


def _jacobian(motion: Pose) -> Array:
    """Jacobian of a motion with respect to the calibration, shape (3, 3)."""
    x, y, turn = motion.tolist()
    return np.array([[x, 0.0, 0.0], [y, 0.0, 0.0], [0.0, turn, x]])
