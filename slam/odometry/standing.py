"""Standing still, recognised by comparing the ranges of scans with those of the first scan of a stand (eq. M68-M70)."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f, norm

from features.scan import LaserScan
from features.se2 import TWO_PI, Array, wrap_angle
from features.sensor import SensorModel
from slam.odometry.rules import StandRules


class StandDetector:
    """Tells whether the robot stands, scan by scan.

    The displacement of each scan against the first one of the stand is measured by its ranges. A robot that stands
    gives displacements that scatter about one value, as much as they differ from one scan to the next.

    Parameters
    ----------
    sensor : limits and mounting.
    rules : how many scans make a stand, and how sure a displacement has to be.

    Attributes
    ----------
    standing : whether the robot stands at the latest scan.
    began : whether the latest scan is the first one of what may become a stand.
    moved, moved_cov : displacement of the latest scans against the first one, robot frame, shape (3,), and covariance.
    """

    def __init__(self, sensor: SensorModel, rules: StandRules = StandRules()) -> None:  # noqa: B008, frozen
        self._sensor = sensor
        self._rules = rules
        self._first: tuple[Array, Array, Array] | None = None
        self._displacements: list[Array] = []
        self.standing = False
        self.began = False
        self.moved: Array = np.zeros(3)
        self.moved_cov: Array = np.zeros((3, 3))

    def __len__(self) -> int:
        """Count the scans since the first one, with it."""
        return len(self._displacements) + (self._first is not None)

    @property
    def displacement_cov(self) -> Array:
        """Covariance of the mean displacement during the stand, shape (3, 3)."""
        return self._scatter() * (2.0 / self._rules.scans)

    def add(self, scan: LaserScan) -> None:
        """Compare a scan, sensor frame as it was taken, with the first one of the stand."""
        displacement = None if self._first is None else self._displacement(scan)
        if displacement is not None:
            self._displacements.append(displacement)
        self.began = displacement is None or self._moved()
        if self.began:
            self._first, self._displacements = _surfaces(scan, self._sensor, self._rules), []
        self.standing = len(self._displacements) >= self._rules.scans

    def restart(self) -> None:
        """Begin anew with the next scan, as the robot has moved after all."""
        self._first, self._displacements, self.standing = None, [], False

    def _scatter(self) -> Array:
        """Covariance of a displacement by the differences from one scan to the next, shape (3, 3)."""
        steps = np.diff(np.array(self._displacements), axis=0)
        return steps.T @ steps / (2.0 * len(steps))

    def _moved(self) -> bool:
        """Whether the latest displacements differ from the first ones by more than chance (eq. M69)."""
        known = np.array(self._displacements)
        count = min(len(known), self._rules.scans) // 2
        # Differences of neighbours share each displacement with the next: two thirds of them are independent.
        freedom = 2.0 * (len(known) - 1) / 3.0
        if freedom <= 3.0:
            return False
        before = known[:count].mean(axis=0)
        gate = 3.0 * freedom / (freedom - 2.0) * float(f.ppf(self._rules.same, 3, freedom - 2.0))
        scatter, late = self._scatter(), known[-count:].mean(axis=0)
        self.moved, self.moved_cov = late, scatter * (2.0 / count)
        return _distance2(late - before, scatter * (2.0 / count)) > gate

    def _displacement(self, scan: LaserScan) -> Array | None:
        """Displacement of a scan against the first one by a robust fit (eq. M68), shape (3,); None without one."""
        assert self._first is not None
        angles, ranges, slopes = self._first
        returned = self._sensor.returned(scan.ranges)
        own, measured = scan.angles[returned] % TWO_PI, scan.ranges[returned]
        if not (len(angles) and len(own)):
            return None
        after = np.searchsorted(angles, own) % len(angles)
        off_after, off_before = wrap_angle(own - angles[after]), wrap_angle(own - angles[after - 1])
        beside = np.where(np.abs(off_after) < np.abs(off_before), after, after - 1)
        off = np.where(np.abs(off_after) < np.abs(off_before), off_after, off_before)
        near = np.abs(off) <= self._rules.beside
        own, off, measured, beside = own[near], off[near], measured[near], beside[near]
        longer = measured - ranges[beside] - slopes[beside] * off
        mounting = self._sensor.mounting
        slants = slopes[beside] / ranges[beside]
        c, s = np.cos(own), np.sin(own)
        forward = np.column_stack([-c - s * slants, -s + c * slants]) @ mounting.axes.T
        turn = np.linalg.det(mounting.axes) * slopes[beside]
        # A robot that turns carries the sensor along.
        turn += forward @ np.array([-mounting.y, mounting.x])
        return _robust_fit(np.column_stack([forward, turn]), longer, self._rules)


def _robust_fit(jacobian: Array, residuals: Array, rules: StandRules) -> Array | None:
    """Least squares with the weights of Cauchy and the scale of the residuals themselves, shape (3,)."""
    shift = np.zeros(3)
    for _ in range(rules.fits):
        left = residuals - jacobian @ shift
        scale = float(np.median(np.abs(left))) / float(norm.ppf(0.75)) if len(left) else 0.0
        weights = 1.0 if scale == 0.0 else 1.0 / (1.0 + (left / (rules.kernel * scale)) ** 2)
        weighted = (jacobian.T * weights).T
        information = weighted.T @ jacobian
        if not np.isfinite(information).all() or np.linalg.matrix_rank(information) < 3:
            return None
        shift = np.linalg.solve(information, weighted.T @ residuals)
    return np.asarray(shift, np.float64)


def _surfaces(scan: LaserScan, sensor: SensorModel, rules: StandRules) -> tuple[Array, Array, Array]:
    """Angles, rising, ranges and slopes of the range by the angle, of beams on a surface that goes on to both sides."""
    returned = sensor.returned(scan.ranges)
    angles, ranges = scan.angles[returned] % TWO_PI, scan.ranges[returned]
    order: NDArray[np.intp] = np.argsort(angles, kind="stable")
    angles, ranges = angles[order], ranges[order]
    before, after = np.roll(ranges, 1), np.roll(ranges, -1)
    span = (np.roll(angles, -1) - np.roll(angles, 1)) % TWO_PI
    kept = (np.maximum(np.abs(before - ranges), np.abs(after - ranges)) < rules.same_surface) & (span > 0.0)
    kept &= span <= 4.0 * rules.beside
    return angles[kept], ranges[kept], ((after - before)[kept] / span[kept])


def _distance2(difference: Array, cov: Array) -> float:
    """Squared Mahalanobis distance; infinite for a difference that the covariance does not allow at all."""
    try:
        return float(difference @ np.linalg.solve(cov, difference))
    except np.linalg.LinAlgError:
        return np.inf if difference.any() else 0.0
