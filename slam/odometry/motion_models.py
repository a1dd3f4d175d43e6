"""Motion models: the motion predicted before a scan is registered, and its covariance."""

import logging
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from features.se2 import Array, Pose, between, compose, inverse, pose, rotate_each, rotation, wrap_angle
from slam.odometry.cloned_pose import PoseClone
from slam.odometry.deskew import Sweep, poses_at
from slam.odometry.rules import CalibrationRules, VelocityRules
from slam.odometry.wheel_calibration import Calibration, WheelCalibration

logger = logging.getLogger(__name__)


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


@dataclass(frozen=True, slots=True, eq=False)
class Jump:
    """A step of the wheels that no robot can make, and what is expected of the motion in its place.

    Parameters
    ----------
    stamp : of the record [s].
    step : motion that the wheels report, shape (3,) [m, m, rad].
    elapsed : time since the record before [s].
    """

    stamp: float
    step: Pose
    elapsed: float


class WheelSpeeds:
    """Speeds that the wheels have shown, to tell a jump of their odometry from a motion (eq. M90).

    Parameters
    ----------
    speed, turn_rate : sigma of the velocity of a robot of which nothing is known [m/s], [rad/s].
    rules : how much faster than that, or than it ever was, no robot is.
    """

    def __init__(
        self,
        speed: float,
        turn_rate: float,
        rules: VelocityRules = VelocityRules(),  # noqa: B008, frozen
    ) -> None:
        self._rules = rules
        self._sigma = np.array([speed, speed, turn_rate])
        self._stamp: float | None = None
        self._interval = MeanInterval(rules)
        self._latest: deque[list[float]] = deque([[0.0, 0.0, 0.0]] * (rules.sustained - 1), rules.sustained)
        self._fastest = 0.0, 0.0
        self._velocity: Array = np.zeros(3)

    def jump(self, stamp: float, step: Pose) -> Jump | None:
        """Return the jump that a step since the record before is, shape (3,); None for a motion."""
        if self._stamp is None:
            self._stamp = stamp
            return None
        elapsed = stamp - self._stamp
        self._stamp = stamp
        self._interval.add(elapsed)
        # Where stamps come in bursts, the step between two of them took as long as any other, or longer by their error.
        interval = self._interval
        longer = max(elapsed, interval.mean) + self._rules.fastest * math.sqrt(interval.variance)
        if longer <= 0.0:
            return None
        velocity = step / longer
        # Plain numbers: this is done for every record, and arrays of three are slow.
        x, y, turn_rate = velocity.tolist()
        _, sigma_speed, sigma_turn_rate = self._sigma.tolist()
        fastest, fastest_turn = self._fastest
        self._latest.append([x, y, turn_rate])
        steady_x, steady_y, steady_turn = (median(values) for values in zip(*self._latest, strict=True))
        self._fastest = max(fastest, math.hypot(steady_x, steady_y)), max(fastest_turn, abs(steady_turn))
        times = self._rules.fastest
        too_fast = math.hypot(x, y) > times * max(sigma_speed, fastest)
        if interval.known and (too_fast or abs(turn_rate) > times * max(sigma_turn_rate, fastest_turn)):
            return Jump(stamp, step, longer)
        self._velocity = velocity
        return None

    def expected(self, elapsed: float) -> tuple[Pose, Array]:
        """Motion at the latest velocity and its covariance, shapes (3,) and (3, 3), where the wheels tell nothing."""
        return self._velocity * elapsed, np.diag(self._sigma * elapsed) ** 2


class WheelMotion:
    """Motion by the wheels, corrected by the calibration of their systematic errors.

    A jump of their odometry is left out: in its place the robot goes on as it did.

    Parameters
    ----------
    model : of their errors.
    speeds : tells a jump from a motion.
    rules : how their systematic errors are learned.

    Attributes
    ----------
    jumps : those that were left out so far.
    pose_odom : latest pose of the wheels without the jumps, odom frame, shape (3,).
    """

    def __init__(
        self,
        model: OdometryModel,
        speeds: WheelSpeeds,
        rules: CalibrationRules = CalibrationRules(),  # noqa: B008, frozen
    ) -> None:
        self._model = model
        self._speeds = speeds
        self._calibration = WheelCalibration(rules)
        self._pose_log: Pose | None = None
        self._pose_odom_log: Pose = np.zeros(3)
        self._pose_step: Pose | None = None
        self._stamp = self._learned = -math.inf
        self.jumps: list[Jump] = []
        self.pose_odom: Pose = np.zeros(3)

    @property
    def pose_log(self) -> Pose:
        """Pose of the log, with its jumps, where the latest step has led, shape (3,)."""
        return compose(inverse(self._pose_odom_log), self.pose_odom if self._pose_step is None else self._pose_step)

    def record(self, stamp: float, pose_log_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the latest step to the next record of the log and its covariance, shapes (3,) and (3, 3)."""
        motion = between(pose_log_robot if self._pose_log is None else self._pose_log, pose_log_robot)
        self._pose_log = pose_log_robot
        jump = self._speeds.jump(stamp, motion)
        if jump is None:
            moved = self._pose_odom_log.any()
            self.pose_odom = compose(self._pose_odom_log, pose_log_robot) if moved else pose_log_robot
            return self.step(stamp, self.pose_odom)
        self.jumps.append(jump)
        expected, cov = self._speeds.expected(jump.elapsed)
        self.pose_odom = compose(self.pose_odom, expected)
        self._pose_odom_log = compose(self.pose_odom, inverse(pose_log_robot))
        x, y, turn = jump.step.tolist()
        logger.warning(
            "at %.3f s: the odometry jumped by %.2f m and %.0f deg in %.2f s: the robot is taken to have gone on",
            stamp, math.hypot(x, y), math.degrees(turn), jump.elapsed,
        )  # fmt: skip
        return self.step(stamp, self.pose_odom, cov)

    def step(self, stamp: float, pose_odom_robot: Pose, unknown_cov: Array | None = None) -> tuple[Pose, Array]:
        """Motion since the latest step and its covariance, shapes (3,) and (3, 3).

        Back to an earlier time, but not beyond the last scan, it takes back what was appended since.

        Parameters
        ----------
        stamp : at its end [s].
        pose_odom_robot : there, without the jumps of the log, shape (3,).
        unknown_cov : covariance that is added where the wheels do not tell the motion, shape (3, 3).
        """
        before = pose_odom_robot if self._pose_step is None else self._pose_step
        back = self._learned <= stamp < self._stamp
        self._pose_step, self._stamp = pose_odom_robot, stamp
        motion = between(pose_odom_robot, before) if back else between(before, pose_odom_robot)
        cov = self._model.covariance(motion)
        motion = self._calibration.corrected(motion)
        if back:
            motion, cov = taken_back(motion, cov)
        if unknown_cov is not None:
            cov = cov + unknown_cov
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
        motions: Array = poses[:-1] - here
        motions[:, :2] = rotate_each(motions[:, :2], -here[2])
        motions[:, 2] = wrap_angle(motions[:, 2])
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


class MeanInterval:
    """Mean interval between stamps, and its variance.

    Parameters
    ----------
    rules : weight of the latest interval, and the longest one that counts.

    Attributes
    ----------
    mean, variance : of the latest intervals [s], [s^2].
    """

    def __init__(self, rules: VelocityRules) -> None:
        self._rules = rules
        self._count = 0
        self.mean = self.variance = 0.0

    @property
    def known(self) -> bool:
        """Whether so many intervals were counted that none weighs more than those to come."""
        return self._count * self._rules.weight >= 1.0

    def add(self, elapsed: float) -> None:
        """Count an interval [s]."""
        self._count += 1
        weight = max(self._rules.weight, 1.0 / self._count)
        off = min(elapsed, self._rules.gap) - self.mean
        self.mean += weight * off
        self.variance = (1.0 - weight) * (self.variance + weight * off**2)


class ConstantVelocity:
    """Motion without odometry: the velocity is an Ornstein-Uhlenbeck process (eq. M34).

    Parameters
    ----------
    speed, turn_rate : sigma of the velocity of a robot of which nothing is known, in x and y [m/s] and about z [rad/s].
    speed_change, turn_rate_change : sigma of its change within one second [m/s], [rad/s].
    rules : what is taken for an irregular stamp, and for a wrong one.

    Attributes
    ----------
    jumps : none, as no wheels are looked at.
    pose_odom : the latest pose in the log, shape (3,).
    """

    def __init__(
        self,
        speed: float,
        turn_rate: float,
        speed_change: float,
        turn_rate_change: float,
        rules: VelocityRules = VelocityRules(),  # noqa: B008, frozen
    ) -> None:
        self.jumps: list[Jump] = []
        self.pose_odom: Pose = np.zeros(3)
        self._rules = rules
        sigma = np.array([speed, speed, turn_rate])
        change = np.array([speed_change, speed_change, turn_rate_change])
        self._variance = sigma**2
        # Correlation time T of the velocity: with noise of spectral density q its stationary variance is q T / 2.
        self._memory = 2.0 * (sigma / change) ** 2
        # A scanner turns steadily, so its intervals should all be alike: their variance is the error of the stamps.
        self._interval = MeanInterval(rules)
        self._learned: float | None = None
        self._stamp = 0.0
        # The robot may be moving when the data begin.
        self._velocity: Array = np.zeros(3)
        self._velocity_cov: Array = np.diag(self._variance)

    @property
    def pose_log(self) -> Pose:
        """The latest pose in the log, shape (3,)."""
        return self.pose_odom

    def record(self, stamp: float, pose_log_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the latest step to the next record of the log; see :meth:`step`."""
        self.pose_odom = pose_log_robot
        return self.step(stamp, pose_log_robot)

    def step(self, stamp: float, pose_odom_robot: Pose) -> tuple[Pose, Array]:
        """Motion since the latest step and its covariance, shapes (3,) and (3, 3); odometry is not looked at."""
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
            self._interval.add(stamp - self._learned)
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
            cov += self._interval.variance * (self._velocity_cov + np.outer(self._velocity, self._velocity))
        return reach * self._velocity, cov

    def learn(self, stamp: float, since: PoseClone) -> bool:
        """Take the motion since the last scan, the latest one at ``stamp``, for the velocity (eq. M35); True."""
        elapsed = stamp - (stamp if self._learned is None else self._learned)
        self._learned = self._stamp = stamp
        if elapsed <= 0.0:
            return True
        self._interval.add(elapsed)
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
