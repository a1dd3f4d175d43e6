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
    """Return unit normal and distance of a line: its points have ``normal_x x + normal_y y = distance``."""
    first = line.params[0]
    if line.form == POLAR:
        return math.cos(first), math.sin(first), line.params[1]
    per_length = 1.0 / math.sqrt(1.0 + first * first)
    distance = (line.params[1] - first * line.center) * per_length
    if line.form == X_ON_Y:
        return per_length, -first * per_length, distance
    return -first * per_length, per_length, distance


@kernel(READ_ONLY, READ_ONLY, f8, f8, f8, f8, from_dtype(LINE_RECORD)[::1], i8)
def scatter_kernel(ranges, angles, range_min, range_max, var_range, var_bearing, lines, least_points):
    """Return variance of a range, its degrees of freedom and the mean range of each line, shape (L, 3) (eq. M107).

    Zero degrees of freedom where a line has too few points or its beams are not found.
    """
    found = np.zeros((lines.size, 3))
    size = ranges.size
    for k in range(lines.size):
        line = lines[k]
        n = line.count
        if n < least_points:
            continue
        normal_x, normal_y, distance = _normal(line)
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
        points = 0
        misfit = sum_range = information = information2 = sum_bearing = 0.0
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
                misfit += w * (across - distance) ** 2
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
        # The misfit is sum(u) var_range + sum(bearing part) in the mean, less the two degrees of freedom of the line,
        # taken from both in proportion.
        kept = (n - 2.0) / n
        found[k, 0] = (misfit - kept * sum_bearing) / (kept * information)
        found[k, 1] = kept * information * information / n * var_range * var_range
        found[k, 2] = sum_range / n
    return found
