"""Conditional weighted linear fitting of one segment (section IV.A of the paper)."""

import math

import numpy as np
from numba import njit

from features.config import Covariance
from features.errors import DegenerateSegmentError
from features.feature import Line
from features.se2 import Array
from features.sensor import SensorModel

VERTICAL, SLOPE, INTERCEPT, CENTER, VAR_SLOPE, VAR_INTERCEPT, COV_SLOPE_INTERCEPT = range(7)
LINE_FIELDS = 7
"""A fitted line inside the compiled kernels: a row of these fields."""


@njit(cache=True)
def fit_cwlf_kernel(xs, ys, first, last, var_range, var_bearing, propagated, row):
    """Fit the points first..last (inclusive) and fill ``row``; False where they do not define a line.

    Weights are eq. 23 or 34 with ``cos(theta) = x / rho``; the propagated covariance carries the effective variance of
    each residual, eq. M3-M6 of docs/math.md, through the weights.
    """
    n = last - first + 1
    mean_x = 0.0
    mean_y = 0.0
    for i in range(first, last + 1):
        mean_x += xs[i]
        mean_y += ys[i]
    mean_x /= n
    mean_y /= n
    spread_x = 0.0
    spread_y = 0.0
    for i in range(first, last + 1):
        spread_x += (xs[i] - mean_x) ** 2
        spread_y += (ys[i] - mean_y) ** 2
    vertical = spread_y > spread_x  # eq. 20-21
    u, v = (ys, xs) if vertical else (xs, ys)

    sum_w = 0.0
    sum_wu = 0.0
    sum_wv = 0.0
    for i in range(first, last + 1):
        w = conditional_weight(u[i], v[i], var_range, var_bearing)
        sum_w += w
        sum_wu += w * u[i]
        sum_wv += w * v[i]
    center = sum_wu / sum_w
    intercept = sum_wv / sum_w  # eq. 30
    sum_wxi2 = 0.0
    sum_wxiv = 0.0
    for i in range(first, last + 1):
        w = conditional_weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center  # eq. 27
        sum_wxi2 += w * xi * xi
        sum_wxiv += w * xi * (v[i] - intercept)
    # Coinciding points leave a spread that is rounding error only.
    if not max(spread_x, spread_y) > n * (1e-9 * (abs(mean_x) + abs(mean_y))) ** 2:
        return False
    slope = sum_wxiv / sum_wxi2  # eq. 29

    misfit = 0.0
    var_slope = 0.0
    var_intercept = 0.0
    cov = 0.0
    for i in range(first, last + 1):
        w = conditional_weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center
        effective = effective_variance(u[i], v[i], slope, var_range, var_bearing)
        residual = v[i] - intercept - slope * xi
        misfit += residual * residual / effective
        var_slope += (w * xi) ** 2 * effective
        var_intercept += w * w * effective
        cov += w * w * xi * effective
    row[VERTICAL] = 1.0 if vertical else 0.0
    row[SLOPE] = slope
    row[INTERCEPT] = intercept
    row[CENTER] = center
    if propagated:
        scale = misfit_scale(misfit, n - 2)
        row[VAR_SLOPE] = scale * var_slope / (sum_wxi2 * sum_wxi2)
        row[VAR_INTERCEPT] = scale * var_intercept / (sum_w * sum_w)
        row[COV_SLOPE_INTERCEPT] = scale * cov / (sum_wxi2 * sum_w)
    else:
        row[VAR_SLOPE] = 1.0 / sum_wxi2  # eq. 31
        row[VAR_INTERCEPT] = 1.0 / sum_w  # eq. 32
        row[COV_SLOPE_INTERCEPT] = 0.0
    return True


@njit(cache=True, inline="always")
def conditional_weight(u, v, var_range, var_bearing):
    """Weight of a point, eq. 23 (u = x, v = y) or eq. 34 (u = y, v = x)."""
    rho2 = u * u + v * v
    return (u * u / (rho2 * var_bearing) + v * v / var_range) / rho2


@njit(cache=True, inline="always")
def effective_variance(u, v, slope, var_range, var_bearing):
    """Variance of the residual of a point: V_v - 2 slope C_uv + slope^2 V_u with eq. 10."""
    rho2 = u * u + v * v
    across = var_bearing * rho2
    radial = v - slope * u
    tangential = u + slope * v
    return (var_range * radial * radial + across * tangential * tangential) / rho2


@njit(cache=True, inline="always")
def misfit_scale(misfit, freedom):
    """Factor on the covariance of a line whose squared residuals over v_i sum to ``misfit`` (eq. M7).

    One as long as chance explains the misfit (three standard deviations of chi-square); a wall that is rougher than the
    sensor's noise is as uncertain as its points show.
    """
    if freedom < 1:
        return 1.0
    return max(1.0, misfit / (freedom + 3.0 * math.sqrt(2.0 * freedom)))


def fit_cwlf(ranges: Array, angles: Array, model: SensorModel, covariance: Covariance = "propagated") -> Line:
    """Fit a line by conditional weighted linear regression.

    Regresses y on x where the points spread along x (N1 >= N2, eq. 20-21), x on y otherwise; weights are eq. 23 or 34,
    estimates eq. 29-30 or 35, covariance eq. 31-32 (``paper``) or eq. M4-M6 of docs/math.md (``propagated``).

    Parameters
    ----------
    ranges, angles : polar coordinates of the points of one segment, sensor frame, shape (n,), n >= 2 [m, rad].
    model : sigma_range [m] and sigma_bearing [rad] of a single beam.
    covariance : form of the covariance.

    Raises
    ------
    DegenerateSegmentError
        Fewer than two points, a point at the sensor itself or not finite, or all points coincide.
    """
    if ranges.size < 2:
        raise DegenerateSegmentError(f"{ranges.size} points do not define a line: expected two or more")
    if not (np.isfinite(ranges) & (ranges > 0.0) & np.isfinite(angles)).all():
        raise DegenerateSegmentError("a segment needs finite angles and positive, finite ranges")
    xs, ys = ranges * np.cos(angles), ranges * np.sin(angles)
    row = np.empty(LINE_FIELDS)
    n = ranges.size
    if not fit_cwlf_kernel(
        xs, ys, 0, n - 1, model.sigma_range**2, model.sigma_bearing**2, covariance == "propagated", row
    ):
        raise DegenerateSegmentError(f"all {n} points coincide")
    ends = np.empty((2, 2))
    project_ends(xs, ys, 0, n - 1, row, ends)
    return Line(
        vertical=bool(row[VERTICAL]),
        slope=float(row[SLOPE]),
        intercept=float(row[INTERCEPT]),
        center=float(row[CENTER]),
        cov=np.array([[row[VAR_SLOPE], row[COV_SLOPE_INTERCEPT]], [row[COV_SLOPE_INTERCEPT], row[VAR_INTERCEPT]]]),
        start=ends[0],
        end=ends[1],
        count=n,
    )


@njit(cache=True)
def project_ends(xs, ys, first, last, row, ends):
    """Project the first and the last point perpendicularly onto the line in ``row``; fill ``ends``, shape (2, 2)."""
    scale = 1.0 / math.sqrt(1.0 + row[SLOPE] ** 2)
    vertical = row[VERTICAL] > 0.5
    for k, i in enumerate((first, last)):
        u, v = (ys[i], xs[i]) if vertical else (xs[i], ys[i])
        along = (u - row[CENTER] + row[SLOPE] * (v - row[INTERCEPT])) * scale * scale
        foot_u = row[CENTER] + along
        foot_v = row[INTERCEPT] + row[SLOPE] * along
        ends[k, 0] = foot_v if vertical else foot_u
        ends[k, 1] = foot_u if vertical else foot_v
