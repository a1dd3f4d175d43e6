"""Fits of a straight line to the points of one segment, one interface for all methods."""

import math

import numpy as np
from numba import njit

from features.config import Covariance, LineFit
from features.errors import DegenerateSegmentError
from features.feature import Line, LineForm
from features.se2 import Array
from features.sensor import SensorModel

FORM, SLOPE, INTERCEPT, CENTER, VAR_SLOPE, VAR_INTERCEPT, COV_SLOPE_INTERCEPT = range(7)
LINE_FIELDS = 7
"""A fitted line inside the compiled kernels: a row of these fields; of a polar line alpha, r and their covariance."""

Y_ON_X, X_ON_Y, POLAR = (int(form) for form in LineForm)

CWLF_PAPER, CWLF_PROPAGATED, ARRAS_SIEGWART, EFFECTIVE_VARIANCE, TOTAL_LEAST_SQUARES = range(5)
"""Methods by the number that the compiled kernels take."""


def method_number(fit: LineFit, covariance: Covariance) -> int:
    """Return the number of a method for the compiled kernels."""
    if fit == "cwlf":
        return CWLF_PAPER if covariance == "paper" else CWLF_PROPAGATED
    return {
        "arras-siegwart": ARRAS_SIEGWART,
        "effective-variance": EFFECTIVE_VARIANCE,
        "total-least-squares": TOTAL_LEAST_SQUARES,
    }[fit]


SUMS = {"reassoc", "contract", "arcp", "nsz"}
"""Freedom for the compiler to run sums on vectors; NaN and infinity keep their meaning."""


MOST_ITERATIONS = 20
"""Of the effective-variance fit; two or three are usual."""


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def _moments(xs, ys, first, last):
    """Return the mean x and y of the points first..last and the sums of x^2, y^2 and x y about them."""
    n = last - first + 1
    # About the first point, so that far from the sensor no digits are lost.
    x0 = xs[first]
    y0 = ys[first]
    sum_x = sum_y = sum_xx = sum_yy = sum_xy = 0.0
    for i in range(first, last + 1):
        x = xs[i] - x0
        y = ys[i] - y0
        sum_x += x
        sum_y += y
        sum_xx += x * x
        sum_yy += y * y
        sum_xy += x * y
    mean_x = sum_x / n
    mean_y = sum_y / n
    spread_x = sum_xx - n * mean_x * mean_x
    spread_y = sum_yy - n * mean_y * mean_y
    return x0 + mean_x, y0 + mean_y, spread_x, spread_y, sum_xy - n * mean_x * mean_y


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def fit_rough(xs, ys, first, last, row):
    """Fit the points first..last (inclusive) by total least squares, eq. 16-17, without a covariance."""
    mean_x, mean_y, spread_x, spread_y, joint = _moments(xs, ys, first, last)
    alpha = 0.5 * math.atan2(-2.0 * joint, spread_y - spread_x)
    row[:] = 0.0
    row[FORM] = POLAR
    row[SLOPE] = alpha
    row[INTERCEPT] = mean_x * math.cos(alpha) + mean_y * math.sin(alpha)


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def fit_kernel(xs, ys, first, last, var_range, var_bearing, method, row):
    """Fit the points first..last (inclusive) and fill ``row``; False where they do not define a line."""
    mean_x, mean_y, spread_x, spread_y, joint = _moments(xs, ys, first, last)
    # Coinciding points leave a spread that is rounding error only.
    if not max(spread_x, spread_y) > (last - first + 1) * (1e-9 * (abs(mean_x) + abs(mean_y))) ** 2:
        return False
    if method in (ARRAS_SIEGWART, TOTAL_LEAST_SQUARES):
        return _fit_polar(xs, ys, first, last, var_range, var_bearing, method == ARRAS_SIEGWART, row)
    steep = spread_y > spread_x  # eq. 20-21
    u, v = (ys, xs) if steep else (xs, ys)
    row[FORM] = X_ON_Y if steep else Y_ON_X
    if method == EFFECTIVE_VARIANCE:
        row[CENTER] = mean_y if steep else mean_x
        row[INTERCEPT] = mean_x if steep else mean_y
        row[SLOPE] = joint / (spread_y if steep else spread_x)
        return _fit_effective(u, v, first, last, var_range, var_bearing, row)
    return _fit_cwlf(u, v, first, last, var_range, var_bearing, method == CWLF_PROPAGATED, row)


@njit(cache=True, inline="always")
def _weight(u, v, var_range, var_bearing):
    """Weight of a point, eq. 23 (u = x, v = y) or eq. 34 (u = y, v = x)."""
    rho2 = u * u + v * v
    return (u * u * var_range + v * v * rho2 * var_bearing) / (rho2 * rho2 * var_range * var_bearing)


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def _fit_cwlf(u, v, first, last, var_range, var_bearing, propagated, row):
    sum_w = sum_wu = sum_wv = 0.0
    for i in range(first, last + 1):
        w = _weight(u[i], v[i], var_range, var_bearing)
        sum_w += w
        sum_wu += w * u[i]
        sum_wv += w * v[i]
    center = sum_wu / sum_w
    intercept = sum_wv / sum_w  # eq. 30
    sum_wxi2 = sum_wxiv = 0.0
    for i in range(first, last + 1):
        w = _weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center  # eq. 27
        sum_wxi2 += w * xi * xi
        sum_wxiv += w * xi * (v[i] - intercept)
    slope = sum_wxiv / sum_wxi2  # eq. 29
    row[SLOPE] = slope
    row[INTERCEPT] = intercept
    row[CENTER] = center
    if not propagated:
        row[VAR_SLOPE] = 1.0 / sum_wxi2  # eq. 31
        row[VAR_INTERCEPT] = 1.0 / sum_w  # eq. 32
        row[COV_SLOPE_INTERCEPT] = 0.0
        return True
    misfit = var_slope = var_intercept = cov = 0.0
    for i in range(first, last + 1):
        w = _weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center
        rho2 = u[i] * u[i] + v[i] * v[i]
        radial = v[i] - slope * u[i]
        tangential = u[i] + slope * v[i]
        effective = var_range * radial * radial / rho2 + var_bearing * tangential * tangential  # eq. M3
        residual = v[i] - intercept - slope * xi
        misfit += residual * residual / effective
        wwe = w * w * effective
        var_slope += wwe * xi * xi
        var_intercept += wwe
        cov += wwe * xi
    scale = misfit_scale(misfit, last - first - 1)
    row[VAR_SLOPE] = scale * var_slope / (sum_wxi2 * sum_wxi2)
    row[VAR_INTERCEPT] = scale * var_intercept / (sum_w * sum_w)
    row[COV_SLOPE_INTERCEPT] = scale * cov / (sum_wxi2 * sum_w)
    return True


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def _fit_effective(u, v, first, last, var_range, var_bearing, row):
    """Maximum likelihood under the noise of the points, by Gauss-Newton from the line in ``row``."""
    slope = row[SLOPE]
    intercept = row[INTERCEPT]
    center = row[CENTER]
    w_aa = w_a = w_1 = determinant = misfit = 0.0
    for _ in range(MOST_ITERATIONS):
        w_aa = w_a = w_1 = g_a = g_1 = misfit = 0.0
        for i in range(first, last + 1):
            ui = u[i]
            vi = v[i]
            rho2 = ui * ui + vi * vi
            radial = vi - slope * ui
            tangential = ui + slope * vi
            # Variance of the residual and half its derivative by the slope.
            radial_part = var_range * radial / rho2
            across_part = var_bearing * tangential
            w = 1.0 / (radial_part * radial + across_part * tangential)
            half_growth = across_part * vi - radial_part * ui
            xi = ui - center
            residual = vi - intercept - slope * xi
            weighted = w * residual
            arm = xi + weighted * half_growth
            w_1 += w
            w_a += w * arm
            w_aa += w * arm * arm
            g_1 += weighted
            g_a += weighted * arm
            misfit += weighted * residual
        determinant = w_aa * w_1 - w_a * w_a
        if not determinant > 0.0:
            return False
        step_slope = (w_1 * g_a - w_a * g_1) / determinant
        step_intercept = (w_aa * g_1 - w_a * g_a) / determinant
        slope += step_slope
        intercept += step_intercept
        # The step is compared with its own standard deviation.
        if (
            step_slope * step_slope * determinant < 1e-8 * w_1
            and step_intercept * step_intercept * determinant < 1e-8 * w_aa
        ):
            break
    scale = misfit_scale(misfit, last - first - 1)
    row[SLOPE] = slope
    row[INTERCEPT] = intercept
    row[VAR_SLOPE] = scale * w_1 / determinant
    row[VAR_INTERCEPT] = scale * w_aa / determinant
    row[COV_SLOPE_INTERCEPT] = -scale * w_a / determinant
    return True


@njit(cache=True, error_model="numpy", fastmath=SUMS)
def _fit_polar(xs, ys, first, last, var_range, var_bearing, weighted, row):
    sum_w = sum_wx = sum_wy = 0.0
    for i in range(first, last + 1):
        w = 1.0 / ((xs[i] * xs[i] + ys[i] * ys[i]) * var_range * var_bearing) if weighted else 1.0  # eq. 3
        sum_w += w
        sum_wx += w * xs[i]
        sum_wy += w * ys[i]
    mean_x = sum_wx / sum_w
    mean_y = sum_wy / sum_w
    s_xx = s_yy = s_xy = 0.0
    for i in range(first, last + 1):
        w = 1.0 / ((xs[i] * xs[i] + ys[i] * ys[i]) * var_range * var_bearing) if weighted else 1.0
        x = xs[i] - mean_x
        y = ys[i] - mean_y
        s_xx += w * x * x
        s_yy += w * y * y
        s_xy += w * x * y
    numerator = -2.0 * s_xy
    denominator = s_yy - s_xx
    alpha = 0.5 * math.atan2(numerator, denominator)  # eq. 17
    c = math.cos(alpha)
    s = math.sin(alpha)
    r = mean_x * c + mean_y * s  # eq. 16
    if r < 0.0:
        alpha += math.pi if alpha <= 0.0 else -math.pi
        r, c, s = -r, -c, -s
    along = mean_y * c - mean_x * s
    norm = numerator * numerator + denominator * denominator
    if not norm > 0.0:
        return False
    var_alpha = var_r = cov = misfit = 0.0
    for i in range(first, last + 1):
        rho2 = xs[i] * xs[i] + ys[i] * ys[i]
        w = 1.0 / (rho2 * var_range * var_bearing) if weighted else 1.0
        x = xs[i] - mean_x
        y = ys[i] - mean_y
        # Derivatives of alpha and r by the point, then by its range and bearing (eq. 19).
        alpha_x = w * (numerator * x - denominator * y) / norm
        alpha_y = -w * (denominator * x + numerator * y) / norm
        r_x = along * alpha_x + w * c / sum_w
        r_y = along * alpha_y + w * s / sum_w
        alpha_rho = alpha_x * xs[i] + alpha_y * ys[i]
        r_rho = r_x * xs[i] + r_y * ys[i]
        alpha_theta = alpha_y * xs[i] - alpha_x * ys[i]
        r_theta = r_y * xs[i] - r_x * ys[i]
        var_alpha += var_range * alpha_rho * alpha_rho / rho2 + var_bearing * alpha_theta * alpha_theta
        var_r += var_range * r_rho * r_rho / rho2 + var_bearing * r_theta * r_theta
        cov += var_range * alpha_rho * r_rho / rho2 + var_bearing * alpha_theta * r_theta
        radial = xs[i] * c + ys[i] * s
        tangential = ys[i] * c - xs[i] * s
        misfit += (radial - r) ** 2 / (var_range * radial * radial / rho2 + var_bearing * tangential * tangential)
    scale = misfit_scale(misfit, last - first - 1)
    row[FORM] = POLAR
    row[SLOPE] = alpha
    row[INTERCEPT] = r
    row[CENTER] = 0.0
    row[VAR_SLOPE] = scale * var_alpha
    row[VAR_INTERCEPT] = scale * var_r
    row[COV_SLOPE_INTERCEPT] = scale * cov
    return True


@njit(cache=True, inline="always")
def misfit_scale(misfit, freedom):
    """Factor on the covariance of a line whose squared residuals over v_i sum to ``misfit`` (eq. M7).

    One as long as chance explains the misfit (three standard deviations of chi-square); a wall that is rougher than the
    sensor's noise is as uncertain as its points show.
    """
    if freedom < 1:
        return 1.0
    return max(1.0, misfit / (freedom + 3.0 * math.sqrt(2.0 * freedom)))


@njit(cache=True, error_model="numpy")
def project_ends(xs, ys, first, last, row, ends):
    """Project the first and the last point perpendicularly onto the line in ``row``; fill ``ends``, shape (2, 2)."""
    if row[FORM] == POLAR:
        c = math.cos(row[SLOPE])
        s = math.sin(row[SLOPE])
        for k, i in enumerate((first, last)):
            offset = row[INTERCEPT] - (xs[i] * c + ys[i] * s)
            ends[k, 0] = xs[i] + offset * c
            ends[k, 1] = ys[i] + offset * s
        return
    scale = 1.0 / (1.0 + row[SLOPE] ** 2)
    steep = row[FORM] == X_ON_Y
    for k, i in enumerate((first, last)):
        u, v = (ys[i], xs[i]) if steep else (xs[i], ys[i])
        along = (u - row[CENTER] + row[SLOPE] * (v - row[INTERCEPT])) * scale
        foot_u = row[CENTER] + along
        foot_v = row[INTERCEPT] + row[SLOPE] * along
        ends[k, 0] = foot_v if steep else foot_u
        ends[k, 1] = foot_u if steep else foot_v


def fit_line(
    ranges: Array,
    angles: Array,
    model: SensorModel,
    fit: LineFit = "effective-variance",
    covariance: Covariance = "propagated",
) -> Line:
    """Fit a line to the points of one segment.

    ``cwlf`` is eq. 20-35 with eq. 31-32 (``paper``) or eq. M4-M6 (``propagated``) for its covariance;
    ``arras-siegwart`` eq. 3 and 16-19; ``effective-variance`` the maximum of the likelihood under eq. 1, eq. M21-M24;
    ``total-least-squares`` eq. 16-19 with equal weights.

    Parameters
    ----------
    ranges, angles : polar coordinates of the points, sensor frame, shape (n,), n >= 2 [m, rad].
    model : sigma_range [m] and sigma_bearing [rad] of a single beam.
    fit : method.
    covariance : form of the covariance; ``paper`` for ``cwlf`` only.

    Raises
    ------
    DegenerateSegmentError
        Fewer than two points, a point at the sensor itself or not finite, or all points coincide.
    ValueError
        The paper's covariance is asked of another method than CWLF.
    """
    if covariance == "paper" and fit != "cwlf":
        raise ValueError(f"the paper's covariance (eq. 31-32) belongs to cwlf, not to {fit}")
    if ranges.size < 2:
        raise DegenerateSegmentError(f"{ranges.size} points do not define a line: expected two or more")
    if not (np.isfinite(ranges) & (ranges > 0.0) & np.isfinite(angles)).all():
        raise DegenerateSegmentError("a segment needs finite angles and positive, finite ranges")
    xs, ys = ranges * np.cos(angles), ranges * np.sin(angles)
    row = np.empty(LINE_FIELDS)
    last = ranges.size - 1
    variances = model.sigma_range**2, model.sigma_bearing**2
    if not fit_kernel(xs, ys, 0, last, *variances, method_number(fit, covariance), row):
        raise DegenerateSegmentError(f"all {ranges.size} points coincide")
    ends = np.empty((2, 2))
    project_ends(xs, ys, 0, last, row, ends)
    return Line(
        form=LineForm(int(row[FORM])),
        params=row[[SLOPE, INTERCEPT]],
        center=float(row[CENTER]),
        cov=np.array([[row[VAR_SLOPE], row[COV_SLOPE_INTERCEPT]], [row[COV_SLOPE_INTERCEPT], row[VAR_INTERCEPT]]]),
        start=ends[0],
        end=ends[1],
        count=ranges.size,
    )


def fit_cwlf(ranges: Array, angles: Array, model: SensorModel, covariance: Covariance = "propagated") -> Line:
    """Fit a line by conditional weighted linear regression: :func:`fit_line` with the paper's method."""
    return fit_line(ranges, angles, model, "cwlf", covariance)
