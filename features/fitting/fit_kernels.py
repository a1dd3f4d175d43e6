# pyright: standard
"""Compiled line fits: each fills the record of a line from the points of one segment."""

import math

from numba import f8, from_dtype, i8

from features.compiled import inner, kernel
from features.config import METHODS
from features.feature import LINE_RECORD, LineForm

LINE = from_dtype(LINE_RECORD)
"""Type of a line inside the compiled kernels."""

Y_ON_X, X_ON_Y, POLAR = (int(form) for form in LineForm)

CWLF_PROPAGATED = METHODS.index(("cwlf", "propagated"))
ARRAS_SIEGWART = METHODS.index(("arras-siegwart", "propagated"))
EFFECTIVE_VARIANCE = METHODS.index(("effective-variance", "propagated"))
TOTAL_LEAST_SQUARES = METHODS.index(("total-least-squares", "propagated"))

SUMS = {"reassoc", "contract", "arcp", "nsz"}
"""Optimisations that let the compiler vectorise sums; NaN and infinity are handled as ever."""

MOST_ITERATIONS = 20
"""Limit of the iterations of the effective-variance fit; two or three are usual."""


@inner(fastmath=SUMS, forceinline=True)
def moments(xs, ys):
    """Return the mean x and y of points and the sums of x^2, y^2 and x y about them."""
    n = xs.size
    # About the first point, so that far from the sensor no digits are lost.
    x0 = xs[0]
    y0 = ys[0]
    sum_x = sum_y = sum_xx = sum_yy = sum_xy = 0.0
    for i in range(n):
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


@inner(inline="always")
def _fill(line, first_param, second_param, center, var_first, var_second, cov):
    line.params[0] = first_param
    line.params[1] = second_param
    line.center = center
    line.cov[0, 0] = var_first
    line.cov[1, 1] = var_second
    line.cov[0, 1] = cov
    line.cov[1, 0] = cov


@inner(inline="always")
def _weight(u, v, var_range, var_bearing):
    """Weight of a point, eq. 23 (u = x, v = y) or eq. 34 (u = y, v = x)."""
    rho2 = u * u + v * v
    return (u * u * var_range + v * v * rho2 * var_bearing) / (rho2 * rho2 * var_range * var_bearing)


@inner(fastmath=SUMS, forceinline=True)
def _fit_cwlf(u, v, var_range, var_bearing, propagated, line):
    sum_w = sum_wu = sum_wv = 0.0
    for i in range(u.size):
        w = _weight(u[i], v[i], var_range, var_bearing)
        sum_w += w
        sum_wu += w * u[i]
        sum_wv += w * v[i]
    center = sum_wu / sum_w
    intercept = sum_wv / sum_w  # eq. 30
    sum_wxi2 = sum_wxiv = 0.0
    for i in range(u.size):
        w = _weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center  # eq. 27
        sum_wxi2 += w * xi * xi
        sum_wxiv += w * xi * (v[i] - intercept)
    slope = sum_wxiv / sum_wxi2  # eq. 29
    if not propagated:
        _fill(line, slope, intercept, center, 1.0 / sum_wxi2, 1.0 / sum_w, 0.0)  # eq. 31-32
        return True
    misfit = var_slope = var_intercept = cov = 0.0
    for i in range(u.size):
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
    scale = misfit_scale(misfit, u.size - 2)
    _fill(
        line,
        slope,
        intercept,
        center,
        scale * var_slope / (sum_wxi2 * sum_wxi2),
        scale * var_intercept / (sum_w * sum_w),
        scale * cov / (sum_wxi2 * sum_w),
    )
    return True


@inner(fastmath=SUMS, forceinline=True)
def _fit_effective(u, v, var_range, var_bearing, slope, intercept, center, line):
    """Maximum likelihood under the noise of the points, by Gauss-Newton from the line that is given."""
    w_aa = w_a = w_1 = determinant = misfit = 0.0
    previous2 = 1.0
    for _ in range(MOST_ITERATIONS):
        w_aa = w_a = w_1 = g_a = g_1 = misfit = 0.0
        offset = intercept - slope * center
        for i in range(u.size):
            ui = u[i]
            vi = v[i]
            radial = vi - slope * ui
            tangential = ui + slope * vi
            # Variance of the residual times rho^2, so that one division serves it and its derivative by the slope.
            rho2 = ui * ui + vi * vi
            radial_part = var_range * radial
            across_part = var_bearing * rho2 * tangential
            share = 1.0 / (radial_part * radial + across_part * tangential)
            w = rho2 * share
            half_growth = (across_part * vi - radial_part * ui) * share
            residual = radial - offset
            arm = ui - center + residual * half_growth
            weighted = w * residual
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
        # Steps shrink by a constant factor: that and the last one predict the next one, in standard deviations.
        size2 = determinant * max(step_slope * step_slope / w_1, step_intercept * step_intercept / w_aa)
        if size2 * size2 < 1e-10 * previous2:
            break
        previous2 = size2
    scale = misfit_scale(misfit, u.size - 2) / determinant
    _fill(line, slope, intercept, center, scale * w_1, scale * w_aa, -scale * w_a)
    return True


@inner(fastmath=SUMS, forceinline=True)
def _fit_polar(xs, ys, var_range, var_bearing, weighted, line):
    sum_w = sum_wx = sum_wy = 0.0
    for i in range(xs.size):
        w = 1.0 / ((xs[i] * xs[i] + ys[i] * ys[i]) * var_range * var_bearing) if weighted else 1.0  # eq. 3
        sum_w += w
        sum_wx += w * xs[i]
        sum_wy += w * ys[i]
    mean_x = sum_wx / sum_w
    mean_y = sum_wy / sum_w
    s_xx = s_yy = s_xy = 0.0
    for i in range(xs.size):
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
    for i in range(xs.size):
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
    scale = misfit_scale(misfit, xs.size - 2)
    line.form = POLAR
    _fill(line, alpha, r, 0.0, scale * var_alpha, scale * var_r, scale * cov)
    return True


@inner(inline="always")
def misfit_scale(misfit, freedom):
    """Factor on the covariance of a line whose squared residuals over v_i sum to ``misfit`` (eq. M7).

    One as long as chance explains the misfit (three standard deviations of chi-square); a wall that is rougher than the
    sensor's noise is as uncertain as its points show.
    """
    if freedom < 1:
        return 1.0
    return max(1.0, misfit / (freedom + 3.0 * math.sqrt(2.0 * freedom)))


@kernel(f8[::1], f8[::1], f8, f8, i8, LINE, fastmath=SUMS, forceinline=True)
def fit_kernel(xs, ys, var_range, var_bearing, method, line):
    """Fit points and fill the record of their line; False where they do not define one."""
    mean_x, mean_y, spread_x, spread_y, joint = moments(xs, ys)
    # Coinciding points leave a spread that is rounding error only.
    if not max(spread_x, spread_y) > xs.size * (1e-9 * (abs(mean_x) + abs(mean_y))) ** 2:
        return False
    if method in (ARRAS_SIEGWART, TOTAL_LEAST_SQUARES):
        return _fit_polar(xs, ys, var_range, var_bearing, method == ARRAS_SIEGWART, line)
    steep = spread_y > spread_x  # eq. 20-21
    u, v = (ys, xs) if steep else (xs, ys)
    line.form = X_ON_Y if steep else Y_ON_X
    if method == EFFECTIVE_VARIANCE:
        center, intercept = (mean_y, mean_x) if steep else (mean_x, mean_y)
        slope = joint / (spread_y if steep else spread_x)
        return _fit_effective(u, v, var_range, var_bearing, slope, intercept, center, line)
    return _fit_cwlf(u, v, var_range, var_bearing, method == CWLF_PROPAGATED, line)


@kernel(f8[::1], f8[::1], LINE)
def project_ends(xs, ys, line):
    """Fill the ends of a fitted line: the first and the last point, projected onto it perpendicularly."""
    if line.form == POLAR:
        c = math.cos(line.params[0])
        s = math.sin(line.params[0])
        for k, i in enumerate((0, xs.size - 1)):
            offset = line.params[1] - (xs[i] * c + ys[i] * s)
            line.ends[k, 0] = xs[i] + offset * c
            line.ends[k, 1] = ys[i] + offset * s
        return
    slope = line.params[0]
    intercept = line.params[1]
    iu, iv = (1, 0) if line.form == X_ON_Y else (0, 1)
    u, v = (ys, xs) if line.form == X_ON_Y else (xs, ys)
    for k, i in enumerate((0, xs.size - 1)):
        along = (u[i] - line.center + slope * (v[i] - intercept)) / (1.0 + slope * slope)
        line.ends[k, iu] = line.center + along
        line.ends[k, iv] = intercept + slope * along
