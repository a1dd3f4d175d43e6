# pyright: standard
"""Meeting of two walls: whether both reach the intersection of their lines, and whether they are no arc."""

import math

from features.compiled import inner
from features.segmentation.breaks import is_before, misfit

SUMS = {"reassoc", "contract", "arcp", "nsz"}
"""Optimisations that let the compiler vectorise sums; NaN and infinity are handled as ever."""

ARC_ITERATIONS = 3
"""Iterations of the fit of an arc: from the algebraic fit the second one changes nothing that counts."""

HOPELESS = 10.0
"""Where the algebraic fit of an arc misses by so many times the limit, the best one is beyond it too: the algebraic fit
of points on an arc misses by a few times what the best one does."""

SURE = -100.0
"""A sum of differences that no later point brings back above the limit."""


@inner()
def normal_of(line):
    """Return the unit normal and the offset of a fitted line, ``normal . p = offset``."""
    x, y = line.ends[0, 0], line.ends[0, 1]
    along_x = line.ends[1, 0] - x
    along_y = line.ends[1, 1] - y
    length = math.sqrt(along_x * along_x + along_y * along_y)
    normal_x = -along_y / length
    normal_y = along_x / length
    return normal_x, normal_y, normal_x * x + normal_y * y


@inner()
def walls_end(xs, ys, first, last, x, y, wall_a, wall_b, noise, rules):
    """Whether no beam on the side of either wall passes its end and hits the other wall behind it (eq. M104).

    Of the points first..last those before the bearing of (x, y) should lie on wall a, those behind it on wall b; walls
    are normal_x, normal_y, offset.
    """
    middle = first
    for i in range(first, last + 1):
        if not is_before(x, y, xs[i], ys[i]):
            middle = i
    limit = 2.0 * math.log(1.0 / rules.corner_level)
    passed = 0.0
    for i in range(middle, first - 1, -1):
        passed += misfit(xs[i], ys[i], wall_a, noise) - misfit(xs[i], ys[i], wall_b, noise)
        if passed > limit:
            return False
        if passed < SURE:
            break
    passed = 0.0
    for i in range(middle + 1, last + 1):
        passed += misfit(xs[i], ys[i], wall_b, noise) - misfit(xs[i], ys[i], wall_a, noise)
        if passed > limit:
            return False
        if passed < SURE:
            break
    return True


@inner(fastmath=SUMS, forceinline=True)
def is_arc(xs, ys, first, last, x, y, wall_a, wall_b, noise, rules):
    """Whether an arc explains the points first..last as well as two walls that meet at (x, y) (eq. M105)."""
    n = last - first + 1
    corner = mean_x = mean_y = 0.0
    for i in range(first, last + 1):
        corner += misfit(xs[i], ys[i], wall_b if is_before(x, y, xs[i], ys[i]) else wall_a, noise)
        mean_x += xs[i]
        mean_y += ys[i]
    limit = corner + 2.0 * math.log(n / rules.straight_level)
    return arc_misfit(xs, ys, first, last, mean_x / n, mean_y / n, noise, HOPELESS * limit) <= limit


@inner(fastmath=SUMS, forceinline=True)
def arc_misfit(xs, ys, first, last, mean_x, mean_y, noise, hopeless):
    """Sum of the squared, normalised distances of points from the arc that fits them best, 0 where none is determined.

    From the algebraic fit (Kasa 1976) by Gauss-Newton iterations on centre and radius; where that is beyond
    ``hopeless``, it stands.
    """
    spread_x = spread_y = joint = cubic_x = cubic_y = square = 0.0
    for i in range(first, last + 1):
        u = xs[i] - mean_x
        v = ys[i] - mean_y
        z = u * u + v * v
        spread_x += u * u
        spread_y += v * v
        joint += u * v
        cubic_x += z * u
        cubic_y += z * v
        square += z
    determinant = 2.0 * (spread_x * spread_y - joint * joint)
    if not determinant > 0.0:
        return 0.0
    centre_x = (cubic_x * spread_y - cubic_y * joint) / determinant
    centre_y = (cubic_y * spread_x - cubic_x * joint) / determinant
    radius = math.sqrt(centre_x * centre_x + centre_y * centre_y + square / (last - first + 1))
    centre_x += mean_x
    centre_y += mean_y
    total = 0.0
    for _ in range(ARC_ITERATIONS):
        xx = xy = yy = x_1 = y_1 = w_1 = g_x = g_y = g_1 = total = 0.0
        for i in range(first, last + 1):
            away_x = xs[i] - centre_x
            away_y = ys[i] - centre_y
            distance = math.sqrt(away_x * away_x + away_y * away_y)
            if distance == 0.0:
                continue
            normal_x = away_x / distance
            normal_y = away_y / distance
            w = 1.0 / variance_across(xs[i], ys[i], normal_x, normal_y, noise)
            residual = distance - radius
            total += w * residual * residual
            xx += w * normal_x * normal_x
            xy += w * normal_x * normal_y
            yy += w * normal_y * normal_y
            x_1 += w * normal_x
            y_1 += w * normal_y
            w_1 += w
            g_x += w * normal_x * residual
            g_y += w * normal_y * residual
            g_1 += w * residual
        if total > hopeless:
            break
        # Cramer's rule.
        c_xx = yy * w_1 - y_1 * y_1
        c_xy = x_1 * y_1 - xy * w_1
        c_x1 = xy * y_1 - x_1 * yy
        c_yy = xx * w_1 - x_1 * x_1
        c_y1 = xy * x_1 - xx * y_1
        c_11 = xx * yy - xy * xy
        determinant = xx * c_xx + xy * c_xy + x_1 * c_x1
        if not determinant > 1e-12 * xx * yy * w_1:
            break
        centre_x += (c_xx * g_x + c_xy * g_y + c_x1 * g_1) / determinant
        centre_y += (c_xy * g_x + c_yy * g_y + c_y1 * g_1) / determinant
        radius += (c_x1 * g_x + c_y1 * g_y + c_11 * g_1) / determinant
    return total


@inner(inline="always")
def variance_across(x, y, normal_x, normal_y, noise):
    """Variance of a point along a unit normal, eq. M3."""
    across = normal_x * x + normal_y * y
    rho2 = x * x + y * y
    return noise[0] * across * across / rho2 + noise[1] * (rho2 - across * across)
