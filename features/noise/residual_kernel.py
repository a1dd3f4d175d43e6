# pyright: standard
"""Compiled estimate of the variance of a range from the points of each line."""

import math

import numpy as np
from numba import f8, from_dtype, i8

from features.compiled import READ_ONLY, inner, kernel
from features.feature import LINE_RECORD, LineForm
from features.returns import is_return
from features.se2 import TWO_PI

Y_ON_X, X_ON_Y, POLAR = (int(form) for form in LineForm)


@inner()
def _normal(line):
    """Unit normal and distance of a line of any form: points on it have ``normal_x x + normal_y y = distance``."""
    first = line.params[0]
    if line.form == POLAR:
        return math.cos(first), math.sin(first), line.params[1]
    per_length = 1.0 / math.sqrt(1.0 + first * first)
    distance = (line.params[1] - first * line.center) * per_length
    if line.form == X_ON_Y:
        return per_length, -first * per_length, distance
    return -first * per_length, per_length, distance


@inner()
def _misfit(m, g):
    """Sum of weighted squares left by a parabola.

    ``m`` holds the moments of the abscissa t up to the fourth, ``g`` those of the residual with 1, t and t^2, and its
    square.
    """
    # Elimination of the symmetric system; the abscissa is centred and of unit spread, so that it is well conditioned.
    a = m[1] / m[0]
    b = m[2] / m[0]
    m11 = m[2] - a * m[1]
    m12 = m[3] - a * m[2]
    m22 = m[4] - b * m[2]
    g1 = g[1] - a * g[0]
    g2 = g[2] - b * g[0]
    if not m11 > 0.0:
        return -1.0
    c = m12 / m11
    m22 -= c * m12
    g2 -= c * g1
    if not m22 > 0.0:
        return -1.0
    return g[3] - g[0] * g[0] / m[0] - g1 * g1 / m11 - g2 * g2 / m22


@kernel(READ_ONLY, READ_ONLY, f8, f8, f8, f8, from_dtype(LINE_RECORD)[::1], i8)
def scatter_kernel(ranges, angles, range_min, range_max, var_range, var_bearing, lines, least_points):
    """Return variance of a range, its degrees of freedom and the mean range of each line, shape (L, 3) (eq. M107).

    Zero degrees of freedom where a line has too few points or its beams are not found.
    """
    found = np.zeros((lines.size, 3))
    size = ranges.size
    moments = np.empty(5)
    products = np.empty(4)
    for k in range(lines.size):
        line = lines[k]
        n = line.count
        if n < least_points:
            continue
        normal_x, normal_y, distance = _normal(line)
        middle = 0.5 * (
            normal_x * (line.ends[0, 1] + line.ends[1, 1]) - normal_y * (line.ends[0, 0] + line.ends[1, 0])
        )
        half = 0.5 * math.hypot(line.ends[1, 0] - line.ends[0, 0], line.ends[1, 1] - line.ends[0, 1])
        if not half > 0.0:
            continue
        first = line.beams[0]
        last = line.beams[1]
        # A line runs counter-clockwise, its beams perhaps against their numbers.
        turn = (angles[last] - angles[first]) % TWO_PI
        ahead = (last - first) % size
        step = 1
        after = angles[(first + 1) % size] if ahead > 0 else angles[first]
        if (after - angles[first]) % TWO_PI > turn:
            step = -1
            ahead = (first - last) % size
        moments[:] = 0.0
        products[:] = 0.0
        points = 0
        sum_range = information = information2 = sum_bearing = 0.0
        beam = first
        for _ in range(ahead + 1):
            rho = ranges[beam]
            if is_return(rho, range_min, range_max):
                x = rho * math.cos(angles[beam])
                y = rho * math.sin(angles[beam])
                across = normal_x * x + normal_y * y
                along = normal_x * y - normal_y * x
                by_range = across * across / (rho * rho)
                by_bearing = var_bearing * along * along
                w = 1.0 / (by_range * var_range + by_bearing)
                t = (along - middle) / half
                r = across - distance
                power = w
                for j in range(5):
                    moments[j] += power
                    if j < 3:
                        products[j] += power * r
                    power *= t
                products[3] += w * r * r
                u = by_range * w
                information += u
                information2 += u * u
                sum_bearing += by_bearing * w
                sum_range += rho
                points += 1
            beam += step
            if beam == size:
                beam = 0
            elif beam < 0:
                beam = size - 1
        if points != n:
            continue
        misfit = _misfit(moments, products)
        if misfit < 0.0:
            continue
        # The misfit is sum(u) var_range + sum(bearing part) in the mean, less the three degrees of freedom of the
        # parabola, taken from both in proportion.
        kept = (n - 3.0) / n
        found[k, 0] = (misfit - kept * sum_bearing) / (kept * information)
        found[k, 1] = kept * information * information / n * var_range * var_range
        found[k, 2] = sum_range / n
    return found
