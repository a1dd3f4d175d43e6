"""Line-aided odometry: each scan is registered to the walls of the recent key frames."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from features.feature import Lines
from features.scan import LaserScan
from features.se2 import Array, Pose, between, compose, inverse, rotation, wrap_angle
from features.sensor import SensorModel
from slam.errors import DivergedError
from slam.odometry.beams import BEFORE, ON, beams_through_walls, judge_beams
from slam.odometry.cloned_pose import ClonedPose, PoseClone
from slam.odometry.deskew import Sweep, doubt_pose, doubt_walls, walls_by_velocity
from slam.odometry.line_map import LineMap, walls_of_lines
from slam.odometry.motion_models import ConstantVelocity, WheelMotion
from slam.odometry.registration import Registration, register
from slam.odometry.rules import LineOdometryRules
from slam.odometry.scan_points import ScanPoints, scan_points
from slam.odometry.standing import StandDetector
from slam.odometry.wheel_calibration import Calibration


@dataclass(slots=True)
class RegistrationCounts:
    """What became of the scans that had walls to be registered to.

    Parameters
    ----------
    registered, failed : scans that fitted, and those that did not, where the prediction stands.
    second_attempts : scans that did not fit at once.
    predictions_rejected : scans that fitted where the prediction, so the wheels, did not allow it.
    odometry_jumps : records whose step no robot can make, so that they were left out.
    """

    registered: int = 0
    failed: int = 0
    second_attempts: int = 0
    predictions_rejected: int = 0
    odometry_jumps: int = 0


class LineOdometry:
    """Dead reckoning that scans correct.

    Parameters
    ----------
    pose_map_robot : first pose, shape (3,); it defines the map frame.
    motion : model that predicts the motion before a scan is registered.
    sensor : noise, limits and mounting.
    line_distance : how far a point may lie from the line of its scan [m].
    key_frames : how many key frames the line map keeps.
    rules : when a scan fits, and what is tried where it does not.

    Attributes
    ----------
    counts : what became of the scans.
    stand_found : how many of the latest scans were taken from one place, where the latest one shows it first; else 0.
    jumped : whether a jump of the wheels was left out between the latest scan and the one before.
    """

    def __init__(
        self,
        pose_map_robot: Pose,
        motion: WheelMotion | ConstantVelocity,
        sensor: SensorModel,
        line_distance: float,
        key_frames: int,
        rules: LineOdometryRules = LineOdometryRules(),  # noqa: B008, frozen
    ) -> None:
        self._rules = rules
        # For a fit beside the prediction.
        self._near_rules = replace(rules.registration, gate=rules.registration.final_gate)
        self._prediction_gate, self._beams_gate = rules.prediction_gate, rules.beams_gate
        self._unknown_cov, self._still_variances = rules.unknown_cov, rules.still_variances
        self._drifting = ClonedPose(pose_map_robot)
        self.counts = RegistrationCounts()
        self._motion = motion
        self._sensor = sensor
        self._line_distance = line_distance
        self._map = LineMap(key_frames)
        self._since_scan = self._drifting.clone()
        self._since_correction = self._drifting.clone()
        self._since_learned = self._drifting.clone()
        self._scan: ScanPoints | None = None
        self._stamp = -math.inf
        self._doubt: Array = np.zeros((3, 3))
        self._stand = StandDetector(sensor, rules.stand)
        self._stood = False
        self.stand_found = 0
        self._since_stand = self._drifting.clone()
        self._fit: Registration | None = None
        self._velocity: Array = np.zeros(3)
        self._jumps = 0
        self.jumped = False
        self._pose_log_scan = pose_map_robot

    @property
    def pose(self) -> Pose:
        """Pose of the robot, map frame, shape (3,)."""
        return self._drifting.pose

    @property
    def pose_odom(self) -> Pose:
        """Latest pose of the wheels without the jumps that were left out, odom frame, shape (3,)."""
        return self._motion.pose_odom

    @property
    def scan(self) -> ScanPoints | None:
        """Points of the latest scan."""
        return self._scan

    @property
    def share(self) -> float | None:
        """Share of the points of the latest scan that lie on known walls; None where it fits nowhere."""
        return None if self._fit is None else self._fit.share

    @property
    def calibration(self) -> Calibration | None:
        """Estimated systematic errors of the wheels; None without wheels."""
        return self._motion.calibration if isinstance(self._motion, WheelMotion) else None

    def clone(self) -> PoseClone:
        """Clone the current pose, to get the motion since then with its covariance."""
        return self._drifting.clone()

    def predict(self, stamp: float, pose_odom_robot: Pose) -> None:
        """Move on to a record by what is expected of the motion.

        Raises
        ------
        DivergedError
            The pose or its covariance is no longer finite.
        """
        self._drifting.move(*self._motion.record(stamp, pose_odom_robot))
        self.counts.odometry_jumps = len(self._motion.jumps)
        if not self._drifting.finite:
            raise DivergedError("the pose or its covariance is no longer finite: look at the odometry")

    def move_to(self, sweep: Sweep) -> None:
        """Move to the middle of a sweep, back or on from the latest record."""
        self._drifting.move(*self._motion.step(sweep.stamp, sweep.pose_odom))

    def sweep(self, scan: LaserScan, stamps: Sequence[float], poses_odom: Sequence[Pose]) -> Sweep | None:
        """Motion during a scan, by the records so far and what was learned of it; None where its beams have no times.

        Its stamp, the middle of the sweep, is not before that of the scan before.
        """
        if scan.times is None or not len(scan):
            return None
        times = scan.stamp + scan.times
        middle = max(0.5 * (float(times.min()) + float(times.max())), self._stamp)
        sweep = self._motion.during(middle, times - middle, stamps, poses_odom)
        finite = math.isfinite(middle) and np.isfinite(sweep.poses_middle_robot).all()
        return sweep if finite and np.isfinite(sweep.velocity_cov).all() else None

    def set_scan(self, scan: LaserScan, lines: Lines, sweep: Sweep | None = None) -> ScanPoints:
        """Remember the points of a scan and its lines, sensor frame, without a correction."""
        jumps = self.counts.odometry_jumps
        self.jumped, self._jumps = jumps > self._jumps, jumps
        mounting = self._sensor.mounting
        walls_robot = walls_of_lines(lines, mounting)
        self._doubt = np.zeros((3, 3))
        if sweep is not None and len(lines):
            by_velocity = walls_by_velocity(walls_robot, lines, scan, mounting, sweep)
            self._doubt = doubt_pose(walls_robot, by_velocity, sweep, self._unknown_cov)
            walls_robot = doubt_walls(walls_robot, by_velocity, sweep)
        self._scan = scan_points(scan, walls_robot, self._sensor, self._line_distance, self._rules.surfaces)
        return self._scan

    def register(self, stamp: float, scan: LaserScan, lines: Lines, sweep: Sweep | None = None) -> ScanPoints:
        """Correct the pose by a scan and its lines, sensor frame; where it fits nowhere the prediction stands.

        Parameters
        ----------
        stamp : of the scan [s]; the middle of its sweep where the motion during it was undone.
        scan, lines : without the motion during the scan, sensor frame.
        sweep : motion during the scan, whose doubt enters the covariance; None where it took no time.
        """
        points = self.set_scan(scan, lines, sweep)
        elapsed = 0.0 if math.isinf(self._stamp) else stamp - self._stamp
        self._stamp = stamp
        if self._rest(stamp):
            return points
        self._fit = self._match(points, elapsed) if len(self._map.walls) else None
        if self._fit is not None and not self._stationary:
            self._drifting.correct(*self._doubted(self._fit))
            self._since_correction.reset()
        if self._motion.learn(stamp, self._since_learned):
            self._since_learned.reset()
        if self._fit is not None and elapsed > 0.0:
            self._velocity = self._since_scan.motion / elapsed
        self._pose_log_scan = self._motion.pose_log
        self._since_scan.reset()
        if self._stand.began:
            self._since_stand.reset()
        return points

    def look_for_stand(self, scan: LaserScan) -> None:
        """Compare a scan, sensor frame as it was taken, with those before; with wheels these tell a stand."""
        self.stand_found = 0
        if isinstance(self._motion, ConstantVelocity):
            self._stood = self._stand.standing
            self._stand.add(scan)

    def _rest(self, stamp: float) -> bool:
        """Whether the robot stands, so that it is where it was before, at first where the stand began (eq. M70)."""
        stand, drifting, since = self._stand, self._drifting, self._since_stand
        if not isinstance(self._motion, ConstantVelocity):
            return False
        if stand.standing and not self._stood:
            cov = since.motion_cov + stand.displacement_cov
            if float(since.motion @ np.linalg.lstsq(cov, since.motion, rcond=None)[0]) > self._prediction_gate:
                # The walls show a motion over which beams can no longer be compared.
                stand.restart()
        if not stand.standing:
            if self._stood:
                drifting.move(*self._motion.rest(stamp))
                drifting.move(np.zeros(3), stand.moved_cov + np.outer(stand.moved, stand.moved))
                self._motion.forget()
            return False
        drifting.move(*self._motion.rest(stamp))
        if not self._stood:
            drifting.move(inverse(since.motion), np.zeros((3, 3)))
            self.stand_found = len(stand)
        self._since_learned.reset()
        self._since_scan.reset()
        self._velocity = np.zeros(3)
        return True

    def _doubted(self, fit: Registration) -> tuple[Array, Array]:
        """Information and pull of a registration, less what the doubt of the motion during the scan takes (eq. M67)."""
        turn = np.eye(3)
        turn[:2, :2] = rotation(float(fit.pose_map_robot[2]))
        kept = np.linalg.inv(np.eye(3) + fit.information @ (turn @ self._doubt @ turn.T))
        information = kept @ fit.information
        return 0.5 * (information + information.T), kept @ fit.pull

    @property
    def _stationary(self) -> bool:
        """Whether the motion since the last correction is known better than a scan could determine it.

        Scans from one place share the errors of the walls: averaging over them would make the covariance too small.
        """
        return bool((self._since_correction.motion_cov.diagonal() < self._still_variances).all())

    def add_key_frame(self) -> None:
        """Put the walls of the latest scan on the line map."""
        if self._scan is None:
            return
        self._map.add(self._scan.walls_robot, self._drifting.pose)

    def _match(self, scan: ScanPoints, elapsed: float) -> Registration | None:
        """Register a scan with the prediction as prior; if it does not fit, with a wide prior."""
        drifting, rules = self._drifting, self._rules
        fit = register(scan, self._map.walls, drifting.pose, drifting.cov, drifting.pose, rules.registration)
        other = self._match_otherwise(scan, fit, elapsed)
        if other is not None:
            self.counts.predictions_rejected += 1
            self.counts.registered += 1
            return other
        beside = self._beside(scan, fit)
        if fit is beside and fit.share < rules.sure_share and self._beams_prefer(scan, drifting.pose, fit):
            # What is near and has a short lever has turned the pose away from walls that are far.
            fit = self._near(scan)
            beside = None if self._beams_prefer(scan, drifting.pose, fit) else self._beside(scan, fit)
        if fit.share < rules.sure_share:
            self.counts.second_attempts += 1
            other, origin = self._match_anywhere(scan)
            if self._fits_better(scan, other, beside):
                self.counts.predictions_rejected += 1
                drifting.move(between(drifting.pose, origin), self._unknown_cov)
                fit = other
            elif fit is not beside:
                self.counts.failed += 1
                return None
        elif fit is not beside:
            slip = _change(fit, drifting.pose)
            slipped = drifting.cov + np.outer(slip, slip)
            fit = register(scan, self._map.walls, drifting.pose, slipped, fit.pose_map_robot, rules.registration)
            if beside is not None and beside.share >= max(rules.sure_share, fit.share):
                fit = beside
            else:
                drifting.inflate(slip)
                if fit.share < rules.sure_share:
                    self.counts.failed += 1
                    return None
                self.counts.predictions_rejected += 1
        self.counts.registered += 1
        return fit

    def _match_otherwise(self, scan: ScanPoints, fit: Registration, elapsed: float) -> Registration | None:
        """Return the registration by another hypothesis of what the wheels did, if the beams prefer it to ``fit``.

        Walls along a jump of the wheels fit wherever it leads: the share of the points on walls does not tell. Beams do
        that end on a wall at the one pose, and go through it or end before it at the other (eq. M91).
        """
        walls, rules = self._map.walls, self._rules
        cov = self._drifting.cov + self._unknown_cov
        best, origin_of_best = fit, self._drifting.pose
        for origin in self._hypotheses(elapsed):
            other = register(scan, walls, origin, cov, origin, rules.registration)
            if _distance2(other, origin) <= self._prediction_gate and self._explains_better(scan, other, best):
                best, origin_of_best = other, origin
        if best is fit:
            return None
        self._drifting.move(between(self._drifting.pose, origin_of_best), self._unknown_cov)
        return best

    def _hypotheses(self, elapsed: float) -> Iterator[Pose]:
        """Poses where the robot is if it went on as before, and if what was left out as a jump was driven."""
        rules, drifting = self._rules, self._drifting
        last = compose(drifting.pose, inverse(self._since_scan.motion))
        steady = compose(last, self._velocity * elapsed)
        x, y, turn = between(steady, drifting.pose).tolist()
        if math.hypot(x, y) > rules.surprise_position or abs(turn) > rules.surprise_heading:
            yield steady
        if self.jumped:
            yield compose(last, between(self._pose_log_scan, self._motion.pose_log))

    def _explains_better(self, scan: ScanPoints, other: Registration, fit: Registration) -> bool:
        """Whether a registration explains a scan better than ``fit``, by the share and by the beams."""
        if other.share <= fit.share:
            return False
        if fit.share < self._rules.least_share:
            return other.share >= self._rules.sure_share
        return self._beams_prefer(scan, other.pose_map_robot, fit)

    def _beams_prefer(self, scan: ScanPoints, pose_map_robot: Pose, fit: Registration) -> bool:
        """Whether the beams that end on a wall at one of two poses only prefer another pose to ``fit`` (eq. M91)."""
        walls, rules = self._map.walls, self._rules.beams
        here, there = (judge_beams(scan, walls, each, rules) for each in (fit.pose_map_robot, pose_map_robot))
        gained = int(((there == ON) & (here >= BEFORE)).sum())
        lost = int(((here == ON) & (there >= BEFORE)).sum())
        return gained > lost and (gained - lost) ** 2 > self._beams_gate * (gained + lost)

    def _beside(self, scan: ScanPoints, fit: Registration) -> Registration | None:
        """Registration inside the gate of the prediction: ``fit``, else one with a narrow gate; None if neither is."""
        drifting = self._drifting
        if _distance2(fit, drifting.pose) <= self._prediction_gate:
            return fit
        near = self._near(scan)
        return near if _distance2(near, drifting.pose) <= self._prediction_gate else None

    def _near(self, scan: ScanPoints) -> Registration:
        """Registration at the prediction with a narrow gate."""
        drifting = self._drifting
        return register(scan, self._map.walls, drifting.pose, drifting.cov, drifting.pose, self._near_rules)

    def _fits_better(self, scan: ScanPoints, other: Registration, beside: Registration | None) -> bool:
        """Whether the registration away from the prediction is better than the one near it.

        The share alone misleads: it is high at a similar place, and low where walls are new. The better pose must also
        have fewer beams that pass through known walls.
        """
        share, here = (0.0, self._drifting.pose) if beside is None else (beside.share, beside.pose_map_robot)
        if other.share < max(self._rules.least_share, share + self._rules.margin):
            return False
        walls, beams = self._map.walls, self._rules.beams
        through = beams_through_walls(scan, walls, other.pose_map_robot, beams)
        return through < beams_through_walls(scan, walls, here, beams)

    def _match_anywhere(self, scan: ScanPoints) -> tuple[Registration, Pose]:
        """Best registration with a wide prior at the current pose or that of the last scan, and the prior pose."""
        rules = self._rules
        cov = self._drifting.cov + self._unknown_cov
        origins = [self._drifting.pose]
        if self._since_scan.travel > rules.far:
            origins.append(compose(self._drifting.pose, inverse(self._since_scan.motion)))
        tries = [
            (
                register(scan, self._map.walls, origin, cov, origin + np.array([0.0, 0.0, turn]), rules.registration),
                origin,
            )
            for origin in origins
            for turn in rules.headings
        ]
        return max(tries, key=lambda attempt: attempt[0].share * (_distance2(*attempt) <= self._prediction_gate))


def _change(fit: Registration, prior: Pose) -> Array:
    """Difference of the coordinates of a fit and its prior, shape (3,)."""
    change = fit.pose_map_robot - prior
    change[2] = wrap_angle(float(change[2]))
    return change


def _distance2(fit: Registration, prior: Pose) -> float:
    """Squared Mahalanobis distance of a fit from its prior."""
    change = _change(fit, prior)
    return float(change @ (fit.pull - fit.information @ change))
