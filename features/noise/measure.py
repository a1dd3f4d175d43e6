"""Standard deviation of a range, from the residuals of the lines of scans."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from features.feature import Features, Lines
from features.noise.residual_kernel import scatter_kernel
from features.noise.rules import NoiseRules
from features.scan import LaserScan
from features.se2 import Array, wrap_angle
from features.sensor import SensorModel

NORMAL_MEDIAN = 0.6744897501960817
"""Median of the absolute value of a standard normal variable."""

Extract = Callable[[LaserScan, SensorModel], Features]
"""Lines and corners of a scan, as :func:`features.extraction.extract` finds them by default."""


@dataclass(frozen=True, slots=True)
class RangeNoise:
    """Noise of a range as the residuals of lines show it.

    Parameters
    ----------
    sigma : standard deviation of a range at the range ``at`` [m].
    error : its relative standard error.
    growth : ``g`` in ``variance = constant + (g range)^2`` where that is significant, else 0.
    lines : how many were measured.
    at : median range of the points that were measured [m].
    """

    sigma: float
    error: float
    growth: float
    lines: int
    at: float

    def carried_to(self, middle: float) -> "RangeNoise":
        """Noise at another range by its growth [m] (eq. M108)."""
        variance = self.sigma**2 + self.growth**2 * (middle**2 - self.at**2)
        # What is nearer than all that was measured has no noise of its own here.
        return self if variance <= 0.0 else replace(self, sigma=math.sqrt(variance), at=middle)


def sigma_of_triples(scan: LaserScan, model: SensorModel) -> float | None:
    """Estimate the standard deviation of a range without lines, from three beams in a row each (eq. M106).

    Three points of a wall lie on a line; the median over all of the distance of the middle one along its beam does not
    see edges. A start for the extraction, which needs a sigma; what the bearings contribute is left in it.

    Returns
    -------
    Standard deviation [m]; None for a scan of too few neighbouring beams.
    """
    seen = model.returned(scan.ranges)
    order = np.argsort(scan.angles[seen], kind="stable")
    ranges, angles = scan.ranges[seen][order], scan.angles[seen][order]
    if ranges.size < 3:
        return None
    before, at, after = ranges[:-2], ranges[1:-1], ranges[2:]
    to_at, to_after = wrap_angle(angles[1:-1] - angles[:-2]), wrap_angle(angles[2:] - angles[1:-1])
    whole = to_at + to_after
    spacing = np.median(np.diff(angles))
    slope = after - before
    # Walls that are met at less than 45 deg, where ranges and not bearings make the distance, without a gap.
    usable = (
        (np.maximum(to_at, to_after) < 1.5 * spacing)
        & (np.minimum(to_at, to_after) > 0.0)
        & (np.abs(slope) < np.minimum(before, after) * whole)
    )
    if not usable.any():
        return None
    before, at, after, to_at, to_after, whole = (each[usable] for each in (before, at, after, to_at, to_after, whole))
    sine = np.sin(whole)
    expected = sine / (np.sin(to_after) / before + np.sin(to_at) / after)
    by_before = expected**2 * np.sin(to_after) / (sine * before**2)
    by_after = expected**2 * np.sin(to_at) / (sine * after**2)
    distances = np.abs(at - expected) / np.sqrt(1.0 + by_before**2 + by_after**2)
    return float(np.median(distances)) / NORMAL_MEDIAN


def triples_of_scans(scans: Sequence[LaserScan], model: SensorModel) -> float | None:
    """Median over scans of :func:`sigma_of_triples` [m]; None where none has enough beams."""
    found = [sigma for scan in scans if (sigma := sigma_of_triples(scan, model)) is not None]
    return float(np.median(found)) if found else None


def line_scatter(scan: LaserScan, lines: Lines, model: SensorModel, rules: NoiseRules) -> Array:
    """Variance of a range, its degrees of freedom and the mean range of the lines that show it, shape (m, 3).

    A line whose residuals bearings dominate shows little of the ranges and is left out (eq. M107).
    """
    found = scatter_kernel(
        scan.ranges, scan.angles, model.range_min, model.range_max, model.sigma_range**2, model.sigma_bearing**2,
        lines.records, rules.least_points,
    )  # fmt: skip
    freedom = np.maximum(lines.counts - 2.0, 0.0)
    return found[(found[:, 1] > 0.0) & (found[:, 1] >= rules.range_share**2 * freedom)]


def pooled_noise(scatter: Array, rules: NoiseRules) -> RangeNoise | None:
    """Pool the variances of lines, shape (m, 3), by their weighted median (eq. M108); None where they tell too little.

    The median is that of lines on smooth walls as long as most are; rougher walls and lines that blend two surfaces lie
    above it.
    """
    if len(scatter) < rules.fewest_lines:
        return None
    variance, error = _median_variance(scatter)
    if error > rules.usable_error:
        return None
    sigma = max(math.sqrt(max(variance, 0.0)), rules.least_sigma)
    at = _weighted_median(scatter[:, 2], scatter[:, 1])
    return RangeNoise(sigma, error, _growth(scatter, rules), len(scatter), at)


def _weighted_median(values: Array, weights: Array) -> float:
    order = np.argsort(values)
    sums: Array = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(sums, 0.5 * sums[-1])])


def _median_variance(scatter: Array) -> tuple[float, float]:
    """Weighted median of the variances and the relative standard error of its root."""
    freedom = scatter[:, 1]
    # Median of chi-square over its mean (Wilson and Hilferty 1931).
    values = scatter[:, 0] / (1.0 - 2.0 / (9.0 * np.maximum(freedom, 1.0))) ** 3
    # The median of a normal sample has pi / 2 times the variance of its mean.
    return _weighted_median(values, freedom), math.sqrt(0.5 * math.pi / (2.0 * float(freedom.sum())))


def _growth(scatter: Array, rules: NoiseRules) -> float:
    """Growth of sigma with range from the nearer and the farther half of the lines; 0 where it is within chance."""
    order = np.argsort(scatter[:, 2])
    weights: Array = np.cumsum(scatter[order, 1])
    half = int(np.searchsorted(weights, 0.5 * float(weights[-1])))
    near, far = scatter[order[:half]], scatter[order[half:]]
    if not len(near) or not len(far):
        return 0.0
    (var_near, error_near), (var_far, error_far) = _median_variance(near), _median_variance(far)
    # Of the variance twice the relative error of its root.
    error = 2.0 * math.hypot(var_near * error_near, var_far * error_far)
    apart = float(np.average(far[:, 2] ** 2, weights=far[:, 1]) - np.average(near[:, 2] ** 2, weights=near[:, 1]))
    if apart <= 0.0 or var_far - var_near <= rules.significance * error:
        return 0.0
    return math.sqrt((var_far - var_near) / apart)


def measure_sigma(
    scans: Sequence[LaserScan], model: SensorModel, extract: Extract, rules: NoiseRules
) -> RangeNoise | None:
    """Measure the standard deviation of a range on scans; None where they show too few walls.

    Extraction and estimate need each other. From below, where a smaller sigma cuts walls into pieces that are still
    smooth, it rises to the smallest sigma that the lines found with it confirm; a larger one may blend surfaces and be
    confirmed by them. Where short pieces tell nothing, a larger one is tried.
    """
    first = triples_of_scans(scans, model)
    if first is None:
        return None
    sigma = max(rules.start * first, rules.least_sigma)
    noise: RangeNoise | None = None
    for _ in range(rules.rounds):
        trial = replace(model, sigma_range=sigma)
        scatter = [line_scatter(scan, extract(scan, trial).lines, trial, rules) for scan in scans]
        found = pooled_noise(np.concatenate(scatter), rules)
        if found is None:
            if noise is not None or sigma > first:
                return noise
            sigma /= rules.start
            continue
        noise = found
        if noise.sigma <= (1.0 + rules.settled) * sigma:
            return noise
        sigma = noise.sigma
    return noise
