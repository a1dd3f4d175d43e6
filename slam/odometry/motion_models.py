"""Motion models: the motion predicted before a scan is registered, and its covariance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from features.se2 import Array, Pose, between, inverse, pose, rotate_each, rotation, wrap_angle
from slam.odometry.cloned_pose import PoseClone
from slam.odometry.deskew import Sweep, poses_at
from slam.odometry.rules import CalibrationRules, VelocityRules
from slam.odometry.wheel_calibration import Calibration, WheelCalibration


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


def taken_back(motion: Pose, cov: Array) -> tuple[Pose, Array]:
    """Motion that, appended to ``motion``, shape (3,), with covariance (3, 3), leaves neither of them (eq. M65)."""
    back = inverse(motion)
    by_motion = np.eye(3)
    by_motion[:2, :2] = rotation(back[2])
    by_motion[:2, 2] = -back[1], back[0]
    return back, -by_motion @ cov @ by_motion.T


class WheelMotion:
    """Motion by the wheels, corrected by the calibration of their systematic errors.

    Parameters
    ----------
    model : of their errors.
    rules : how their systematic errors are learned.
    """

    def __init__(
        self,
        model: OdometryModel,
        rules: CalibrationRules = CalibrationRules(),  # noqa: B008, frozen
    ) -> None:
        self._model = model
        self._calibration = WheelCalibration(rules)
        self._pose_odom_robot: Pose | None = None
        self._stamp = self._learned = -math.inf

    def step(self, stamp: float, pose_odom_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the record before and its covariance, shapes (3,) and (3, 3).

        Back to an earlier time, but not beyond the last scan, it takes back what was appended since.
        """
        before = pose_odom_robot if self._pose_odom_robot is None else self._pose_odom_robot
        back = self._learned <= stamp < self._stamp
        self._pose_odom_robot, self._stamp = pose_odom_robot, stamp
        motion = between(pose_odom_robot, before) if back else between(before, pose_odom_robot)
        cov = self._model.covariance(motion)
        motion = self._calibration.corrected(motion)
        if back:
            motion, cov = taken_back(motion, cov)
        self._calibration.move(motion, cov)
        return motion, cov

    def during(self, middle: float, times: Array, stamps: Sequence[float], poses_odom: Sequence[Pose]) -> Sweep:
        """Motion during a sweep by the records so far, corrected by the calibration.

        Parameters
        ----------
        middle : of the sweep [s].
        times : of the beams after it, shape (n,) [s].
        stamps, poses_odom : of the records so far, shape (3,) each.
        """
        duration = float(np.ptp(times))
        poses = poses_at(np.append(middle + times, middle), stamps, poses_odom, duration)
        here = poses[-1]
        motions = np.column_stack(
            [rotate_each(poses[:-1, :2] - here[:2], -here[2]), wrap_angle(poses[:-1, 2] - here[2])]
        )
        calibration = self._calibration.calibration
        motions[:, 2] += calibration.turn * motions[:, 2] + calibration.drift * motions[:, 0]
        motions[:, :2] *= 1.0 + calibration.travel
        here[2] = wrap_angle(here[2])
        velocity = np.zeros(3)
        if duration > 0.0:
            velocity = (motions[times.argmax()] - motions[times.argmin()]) / duration
        return Sweep(middle, here, times, motions, self._calibration.doubt(velocity))

    def learn(self, stamp: float, since: PoseClone) -> bool:
        """Update the wheel calibration; False where the motion was too short."""
        self._learned = stamp
        return self._calibration.learn(since)

    @property
    def calibration(self) -> Calibration:
        """What is added to the motion that the wheels report."""
        return self._calibration.calibration


class ConstantVelocity:
    """Motion without odometry: the velocity is an Ornstein-Uhlenbeck process (eq. M34).

    Parameters
    ----------
    speed, turn_rate : sigma of the velocity of a robot of which nothing is known, in x and y [m/s] and about z [rad/s].
    speed_change, turn_rate_change : sigma of its change within one second [m/s], [rad/s].
    rules : what is taken for an irregular stamp, and for a wrong one.
    """

    def __init__(
        self,
        speed: float,
        turn_rate: float,
        speed_change: float,
        turn_rate_change: float,
        rules: VelocityRules = VelocityRules(),  # noqa: B008, frozen
    ) -> None:
        self._rules = rules
        sigma = np.array([speed, speed, turn_rate])
        change = np.array([speed_change, speed_change, turn_rate_change])
        self._variance = sigma**2
        # Correlation time T of the velocity: with noise of spectral density q its stationary variance is q T / 2.
        self._memory = 2.0 * (sigma / change) ** 2
        self._count = 0
        self._interval = 0.0
        self._jitter2 = 0.0
        self._learned: float | None = None
        self._stamp = 0.0
        # The robot may be moving when the data begin.
        self._velocity: Array = np.zeros(3)
        self._velocity_cov: Array = np.diag(self._variance)

    def step(self, stamp: float, pose_odom_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the record before and its covariance, shapes (3,) and (3, 3); odometry is not looked at."""
        if self._learned is None:
            # Where the first scan is taken the motion begins.
            return np.zeros(3), np.zeros((3, 3))
        # A record from before the last scan adds nothing: the motion counts from there.
        before, after = (self._motion(max(0.0, time - self._learned)) for time in (self._stamp, stamp))
        back = stamp < self._stamp
        self._stamp = stamp
        if back:
            before, after = after, before
        x, y, turn = after[0] - before[0]
        motion, cov = pose(x, y, turn), after[1] - before[1]
        return taken_back(motion, cov) if back else (motion, cov)

    def during(self, middle: float, times: Array, stamps: Sequence[float], poses_odom: Sequence[Pose]) -> Sweep:
        """Motion during a sweep by the velocity of the last scans; see :meth:`WheelMotion.during`."""
        kept = np.exp(-max(0.0, middle - (middle if self._learned is None else self._learned)) / self._memory)
        velocity_cov = np.outer(kept, kept) * self._velocity_cov + np.diag(self._variance * (1.0 - kept**2))
        return Sweep(middle, poses_odom[-1], times, times[:, None] * (kept * self._velocity), velocity_cov)

    def rest(self, stamp: float) -> tuple[Pose, Array]:
        """Motion that takes back what was expected since the last scan, as the robot stands at ``stamp``."""
        elapsed = 0.0 if self._learned is None else max(0.0, self._stamp - self._learned)
        motion, cov = self._motion(elapsed)
        if self._learned is not None and stamp > self._learned:
            self._time(stamp - self._learned)
        self._learned = self._stamp = stamp
        self._velocity, self._velocity_cov = np.zeros(3), np.zeros((3, 3))
        return taken_back(pose(*motion.tolist()), cov)

    def _motion(self, elapsed: float) -> tuple[Array, Array]:
        """Motion since the last scan and its covariance, shapes (3,) and (3, 3), eq. M34; none in no time."""
        ratio = elapsed / self._memory
        lost = -np.expm1(-ratio)
        reach = self._memory * lost
        walk = np.maximum(self._variance * self._memory**2 * (2.0 * (ratio - lost) - lost**2), 0.0)
        cov = np.outer(reach, reach) * self._velocity_cov + np.diag(walk)
        if elapsed > 0.0:
            cov += self._jitter2 * (self._velocity_cov + np.outer(self._velocity, self._velocity))
        return reach * self._velocity, cov

    def learn(self, stamp: float, since: PoseClone) -> bool:
        """Take the motion since the last scan, the latest one at ``stamp``, for the velocity (eq. M35); True."""
        elapsed = stamp - (stamp if self._learned is None else self._learned)
        self._learned = self._stamp = stamp
        if elapsed <= 0.0:
            return True
        self._time(elapsed)
        motion, cov = self._motion(elapsed)
        lost = -np.expm1(-elapsed / self._memory)
        kept = 1.0 - lost
        reach = self._memory * lost
        cross = kept[:, None] * self._velocity_cov * reach + np.diag(self._variance * self._memory * lost**2)
        gain = np.linalg.solve(cov, cross.T).T
        residual = since.motion - motion
        residual[2] = wrap_angle(float(residual[2]))
        self._velocity = kept * self._velocity + gain @ residual
        velocity_cov = np.outer(kept, kept) * self._velocity_cov + np.diag(self._variance * (1.0 - kept**2))
        velocity_cov += gain @ (since.motion_cov - cov) @ gain.T
        self._velocity_cov = 0.5 * (velocity_cov + velocity_cov.T)
        if (self._velocity**2 + np.diag(velocity_cov) > self._rules.fastest**2 * self._variance).any():
            self.forget()
        return True

    def forget(self) -> None:
        """Know nothing of the velocity."""
        self._velocity, self._velocity_cov = np.zeros(3), np.diag(self._variance)

    def _time(self, elapsed: float) -> None:
        """Learn how irregular the stamps are: a scanner turns steadily, so its intervals should all be alike."""
        self._count += 1
        weight = max(self._rules.weight, 1.0 / self._count)
        off = min(elapsed, self._rules.gap) - self._interval
        self._interval += weight * off
        self._jitter2 = (1.0 - weight) * (self._jitter2 + weight * off**2)
