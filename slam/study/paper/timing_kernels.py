# pyright: standard
"""The four steps of a corner as compiled functions of their own, for the timing study only.

The extraction computes parameters and covariance in one function per method. Here each step stands alone, so that it
can be timed: line, covariance of the line, corner, covariance of the corner. Arras-Siegwart is here twice, by sums
that are gone through once and by the double sums as eq. 17 is printed.
"""

import math

import numpy as np
from numba import f8, i8

from features.compiled import inner, kernel

CWLF, ARRAS_SIEGWART, ARRAS_SIEGWART_LITERAL = range(3)
LINES, LINE_COVS, CORNER, CORNER_COV = range(4)
"""Steps in their order."""


@inner(inline="always")
def _weight(x, y, var_range, var_bearing):
    """Weight of eq. 23."""
    rho2 = x * x + y * y
    return (x * x * var_range + y * y * rho2 * var_bearing) / (rho2 * rho2 * var_range * var_bearing)


@inner(fastmath={"reassoc", "contract", "arcp", "nsz"})
def cwlf_line(xs, ys, var_range, var_bearing, line):
    """Fill slope, intercept, centre and axis of a line, eq. 20-30 and 33-35, and the two sums of eq. 31-32."""
    n = xs.size
    x0, y0 = xs[0], ys[0]
    sum_x = sum_y = sum_xx = sum_yy = 0.0
    for i in range(n):
        x, y = xs[i] - x0, ys[i] - y0
        sum_x += x
        sum_y += y
        sum_xx += x * x
        sum_yy += y * y
    steep = sum_yy * n - sum_y * sum_y > sum_xx * n - sum_x * sum_x
    u, v = (ys, xs) if steep else (xs, ys)
    sum_w = sum_wu = sum_wv = 0.0
    for i in range(n):
        w = _weight(u[i], v[i], var_range, var_bearing)
        sum_w += w
        sum_wu += w * u[i]
        sum_wv += w * v[i]
    center, intercept = sum_wu / sum_w, sum_wv / sum_w
    sum_wxi2 = sum_wxiv = 0.0
    for i in range(n):
        w = _weight(u[i], v[i], var_range, var_bearing)
        xi = u[i] - center
        sum_wxi2 += w * xi * xi
        sum_wxiv += w * xi * v[i]
    line[0] = sum_wxiv / sum_wxi2
    line[1] = intercept
    line[2] = center
    line[3] = 1.0 if steep else 0.0
    line[4] = sum_wxi2
    line[5] = sum_w


@inner()
def cwlf_line_cov(line, cov):
    """Fill the covariance of eq. 31-32: two divisions, the sums are those of the line itself."""
    cov[0] = 1.0 / line[4]
    cov[1] = 1.0 / line[5]
    cov[2] = 0.0


@inner()
def _finish_polar(numerator, denominator, mean_x, mean_y, sum_w, line):
    alpha = 0.5 * math.atan2(numerator, denominator)
    line[0] = alpha
    line[1] = mean_x * math.cos(alpha) + mean_y * math.sin(alpha)
    line[2] = numerator
    line[3] = denominator
    line[4] = mean_x
    line[5] = mean_y
    line[6] = sum_w


@inner(fastmath={"reassoc", "contract", "arcp", "nsz"})
def polar_line(xs, ys, var_range, var_bearing, line):
    """Fill alpha, r, numerator and denominator of eq. 16-17, weights of eq. 3, by single sums."""
    sum_w = sum_wx = sum_wy = 0.0
    for i in range(xs.size):
        w = 1.0 / ((xs[i] * xs[i] + ys[i] * ys[i]) * var_range * var_bearing)
        sum_w += w
        sum_wx += w * xs[i]
        sum_wy += w * ys[i]
    mean_x, mean_y = sum_wx / sum_w, sum_wy / sum_w
    s_xx = s_yy = s_xy = 0.0
    for i in range(xs.size):
        w = 1.0 / ((xs[i] * xs[i] + ys[i] * ys[i]) * var_range * var_bearing)
        x, y = xs[i] - mean_x, ys[i] - mean_y
        s_xx += w * x * x
        s_yy += w * y * y
        s_xy += w * x * y
    _finish_polar(-2.0 * s_xy, s_yy - s_xx, mean_x, mean_y, sum_w, line)


@kernel(f8[::1], f8[::1], f8, f8, f8[::1], fastmath={"reassoc", "contract", "arcp", "nsz"})
def polar_line_literal(ranges, angles, var_range, var_bearing, line):
    """Fill the same from the double sums of eq. 17 as they are printed, term by term."""
    n = ranges.size
    sum_w = sum_wx = sum_wy = 0.0
    for i in range(n):
        w = 1.0 / (ranges[i] * ranges[i] * var_range * var_bearing)
        sum_w += w
        sum_wx += w * ranges[i] * math.cos(angles[i])
        sum_wy += w * ranges[i] * math.sin(angles[i])
    double_num = double_den = single_num = single_den = 0.0
    for i in range(n):
        w_i = 1.0 / (ranges[i] * ranges[i] * var_range * var_bearing)
        single_num += w_i * ranges[i] * ranges[i] * math.sin(2.0 * angles[i])
        single_den += w_i * ranges[i] * ranges[i] * math.cos(2.0 * angles[i])
        for j in range(n):
            w_j = 1.0 / (ranges[j] * ranges[j] * var_range * var_bearing)
            factor = w_i * ranges[i] * w_j * ranges[j]
            double_num += factor * math.sin(angles[i]) * math.cos(angles[j])
            double_den += factor * math.cos(angles[j] + angles[i])
    numerator = 2.0 / sum_w * double_num - single_num
    denominator = double_den / sum_w - single_den
    _finish_polar(numerator, denominator, sum_wx / sum_w, sum_wy / sum_w, sum_w, line)


@inner(fastmath={"reassoc", "contract", "arcp", "nsz"})
def polar_line_cov(xs, ys, var_range, var_bearing, line, cov):
    """Fill the covariance of eq. 18-19: the derivatives by range and bearing of each point, from the sums."""
    c, s = math.cos(line[0]), math.sin(line[0])
    numerator, denominator, mean_x, mean_y, sum_w = line[2], line[3], line[4], line[5], line[6]
    norm = numerator * numerator + denominator * denominator
    along = mean_y * c - mean_x * s
    var_alpha = var_r = both = 0.0
    for i in range(xs.size):
        rho2 = xs[i] * xs[i] + ys[i] * ys[i]
        w = 1.0 / (rho2 * var_range * var_bearing)
        x, y = xs[i] - mean_x, ys[i] - mean_y
        alpha_x = w * (numerator * x - denominator * y) / norm
        alpha_y = -w * (denominator * x + numerator * y) / norm
        r_x, r_y = along * alpha_x + w * c / sum_w, along * alpha_y + w * s / sum_w
        alpha_rho, r_rho = alpha_x * xs[i] + alpha_y * ys[i], r_x * xs[i] + r_y * ys[i]
        alpha_theta, r_theta = alpha_y * xs[i] - alpha_x * ys[i], r_y * xs[i] - r_x * ys[i]
        var_alpha += var_range * alpha_rho * alpha_rho / rho2 + var_bearing * alpha_theta * alpha_theta
        var_r += var_range * r_rho * r_rho / rho2 + var_bearing * r_theta * r_theta
        both += var_range * alpha_rho * r_rho / rho2 + var_bearing * alpha_theta * r_theta
    cov[0] = var_alpha
    cov[1] = var_r
    cov[2] = both


@inner(fastmath={"reassoc", "contract", "arcp", "nsz"})
def polar_line_cov_literal(ranges, angles, var_range, var_bearing, line, cov):
    """Fill the same with the sum over j in the derivative of each double sum of eq. 17 taken anew for each point."""
    n = ranges.size
    c, s = math.cos(line[0]), math.sin(line[0])
    numerator, denominator, mean_x, mean_y, sum_w = line[2], line[3], line[4], line[5], line[6]
    norm = numerator * numerator + denominator * denominator
    along = mean_y * c - mean_x * s
    var_alpha = var_r = both = 0.0
    for i in range(n):
        w = 1.0 / (ranges[i] * ranges[i] * var_range * var_bearing)
        sin_i, cos_i = math.sin(angles[i]), math.cos(angles[i])
        num_rho = den_rho = num_theta = den_theta = 0.0
        for j in range(n):
            w_rho = w * ranges[j] / (ranges[j] * ranges[j] * var_range * var_bearing)
            num_rho += w_rho * math.sin(angles[i] + angles[j])
            den_rho += w_rho * math.cos(angles[i] + angles[j])
            num_theta += w_rho * ranges[i] * math.cos(angles[i] + angles[j])
            den_theta -= w_rho * ranges[i] * math.sin(angles[i] + angles[j])
        w_rho = 2.0 * w * ranges[i]
        num_rho = 2.0 / sum_w * num_rho - w_rho * math.sin(2.0 * angles[i])
        den_rho = 2.0 / sum_w * den_rho - w_rho * math.cos(2.0 * angles[i])
        num_theta = 2.0 / sum_w * num_theta - w_rho * ranges[i] * math.cos(2.0 * angles[i])
        den_theta = 2.0 / sum_w * den_theta + w_rho * ranges[i] * math.sin(2.0 * angles[i])
        alpha_rho = 0.5 * (denominator * num_rho - numerator * den_rho) / norm
        alpha_theta = 0.5 * (denominator * num_theta - numerator * den_theta) / norm
        r_rho = along * alpha_rho + w * (cos_i * c + sin_i * s) / sum_w
        r_theta = along * alpha_theta + w * ranges[i] * (cos_i * s - sin_i * c) / sum_w
        var_alpha += var_range * alpha_rho * alpha_rho + var_bearing * alpha_theta * alpha_theta
        var_r += var_range * r_rho * r_rho + var_bearing * r_theta * r_theta
        both += var_range * alpha_rho * r_rho + var_bearing * alpha_theta * r_theta
    cov[0] = var_alpha
    cov[1] = var_r
    cov[2] = both


@inner()
def cwlf_corner(a, b, corner):
    """Fill the intersection of two regression lines, eq. 40-41, 43-44 or 46-47."""
    if a[3] == b[3]:
        difference = b[0] - a[0]
        u = (b[0] * b[2] - a[0] * a[2] + a[1] - b[1]) / difference
        v = a[0] * (u - a[2]) + a[1]
        corner[0], corner[1] = (v, u) if a[3] == 1.0 else (u, v)
    else:
        flat, steep = (b, a) if a[3] == 1.0 else (a, b)
        x = (steep[0] * (flat[1] - flat[0] * flat[2] - steep[2]) + steep[1]) / (1.0 - flat[0] * steep[0])
        corner[0] = x
        corner[1] = flat[0] * (x - flat[2]) + flat[1]


@inner()
def polar_corner(a, b, corner):
    """Fill the intersection of two polar lines, eq. 36-37."""
    determinant = math.sin(b[0] - a[0])
    corner[0] = (a[1] * math.sin(b[0]) - b[1] * math.sin(a[0])) / determinant
    corner[1] = (b[1] * math.cos(a[0]) - a[1] * math.cos(b[0])) / determinant


@inner()
def corner_cov(normal_a, normal_b, across, cov):
    """Fill the covariance of an intersection from the variance that each line has across itself there."""
    determinant = normal_a[0] * normal_b[1] - normal_a[1] * normal_b[0]
    k = 1.0 / (determinant * determinant)
    cov[0] = k * (normal_b[1] ** 2 * across[0] + normal_a[1] ** 2 * across[1])
    cov[1] = k * (normal_b[0] ** 2 * across[0] + normal_a[0] ** 2 * across[1])
    cov[2] = -k * (normal_b[0] * normal_b[1] * across[0] + normal_a[0] * normal_a[1] * across[1])


@inner()
def normal_and_variance(polar, line, cov, corner, normal):
    """Fill a normal of a line; return the variance of its equation at the corner (the rows of eq. 39, 42, 45, 48)."""
    if polar:
        c, s = math.cos(line[0]), math.sin(line[0])
        normal[0], normal[1] = c, s
        arm = corner[1] * c - corner[0] * s
        return arm * arm * cov[0] + cov[1] - 2.0 * arm * cov[2]
    steep = line[3] == 1.0
    normal[0], normal[1] = (1.0, -line[0]) if steep else (-line[0], 1.0)
    arm = corner[1 if steep else 0] - line[2]
    return arm * arm * cov[0] + cov[1] + 2.0 * arm * cov[2]


@kernel(i8, i8, i8, i8, f8[:, ::1], f8[:, ::1], f8, f8, f8[:, ::1], f8[:, ::1], f8[::1], f8[::1])
def run_steps(
    method, first_step, last_step, times, first, second, var_range, var_bearing, line, cov, corner, cov_corner
):
    """Do the steps from ``first_step`` to ``last_step`` so many times; the walls hold rows x, y, range, angle.

    What comes before the first step is taken from the arrays, as an earlier call left it.
    """
    normal = np.empty((2, 2))
    across = np.empty(2)
    for _ in range(times):
        for k in range(2):
            points = first if k == 0 else second
            # No pass is like the one before: the compiler cannot take it out of the loop.
            points[0, 0] += 1e-13
            points[2, 0] += 1e-13
            line[k, 1] += 1e-13
            if first_step <= LINES <= last_step:
                if method == CWLF:
                    cwlf_line(points[0], points[1], var_range, var_bearing, line[k])
                elif method == ARRAS_SIEGWART:
                    polar_line(points[0], points[1], var_range, var_bearing, line[k])
                else:
                    polar_line_literal(points[2], points[3], var_range, var_bearing, line[k])
            if first_step <= LINE_COVS <= last_step:
                if method == CWLF:
                    cwlf_line_cov(line[k], cov[k])
                elif method == ARRAS_SIEGWART:
                    polar_line_cov(points[0], points[1], var_range, var_bearing, line[k], cov[k])
                else:
                    polar_line_cov_literal(points[2], points[3], var_range, var_bearing, line[k], cov[k])
        if first_step <= CORNER <= last_step:
            if method == CWLF:
                cwlf_corner(line[0], line[1], corner)
            else:
                polar_corner(line[0], line[1], corner)
        if first_step <= CORNER_COV <= last_step:
            for k in range(2):
                across[k] = normal_and_variance(method != CWLF, line[k], cov[k], corner, normal[k])
            corner_cov(normal[0], normal[1], across, cov_corner)
