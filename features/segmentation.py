"""From beams to straight segments: jump-distance clusters, split by iterative end point fit (IEPF)."""

import math

import numpy as np
from numba import njit

from features.line_fit import INTERCEPT, SLOPE
from features.se2 import TWO_PI


@njit(cache=True, error_model="numpy")
def order_beams(angles):
    """Return the beams in counter-clockwise order, shape (n,), and their angles, rising over at most one turn."""
    n = angles.size
    rising = True
    falling = True
    for i in range(1, n):
        step = angles[i] - angles[i - 1]
        rising = rising and step >= 0.0
        falling = falling and step <= 0.0
    if abs(angles[n - 1] - angles[0]) < TWO_PI:
        if rising:
            return np.arange(n), angles
        if falling:
            return np.arange(n)[::-1].copy(), angles[::-1].copy()
    wrapped = angles % TWO_PI
    order = np.argsort(wrapped, kind="mergesort")
    return order, wrapped[order]


@njit(cache=True, error_model="numpy")
def mean_spacing(angles):
    """Mean angle between neighbouring beams, rising over at most one turn, across the arc that they cover [rad]."""
    n = angles.size
    if n < 2:
        return 0.0
    largest = angles[0] - angles[n - 1] + TWO_PI
    for i in range(1, n):
        largest = max(largest, angles[i] - angles[i - 1])
    return (TWO_PI - largest) / (n - 1)


@njit(cache=True, error_model="numpy")
def rotate(values, start):
    """Rotate an array in place so that it begins with its element ``start``."""
    head = values[:start].copy()
    rest = values.size - start
    for i in range(rest):
        values[i] = values[i + start]
    values[rest:] = head


@njit(cache=True, error_model="numpy")
def find_jumps(xs, ys, ranges, angles, n, slack, jump_angle, largest_gap, jumps):
    """Mark each of the n points behind which a segment ends, the last against the first; True where there is none.

    The allowed jump follows a wall that is seen at ``jump_angle`` or steeper (Borges and Aldon 2004): it grows with the
    range and with the angle between the beams, by ``slack`` for the noise; a gap of more than ``largest_gap`` always
    ends a segment (eq. M9).
    """
    sin_jump = math.sin(jump_angle)
    closed = True
    for i in range(n):
        k = i + 1
        gap = angles[k] - angles[i] if k < n else angles[0] + TWO_PI - angles[i]
        if k == n:
            k = 0
        if gap > largest_gap or gap >= math.pi:
            jumps[i] = True
            closed = False
            continue
        # The far point lies near sin(gap) / sin(jump_angle) away where the beam meets the wall at jump_angle.
        sin_gap = (xs[i] * ys[k] - ys[i] * xs[k]) / (ranges[i] * ranges[k])
        limit = min(ranges[i], ranges[k]) * sin_gap / sin_jump + slack
        jumps[i] = (xs[k] - xs[i]) ** 2 + (ys[k] - ys[i]) ** 2 > limit * limit
        closed = closed and not jumps[i]
    return closed


@njit(cache=True, error_model="numpy")
def split_segments(xs, ys, first, last, var_range, var_bearing, floor, sigmas, stack, firsts):
    """Split the points first..last by IEPF; fill ``firsts`` with the first point of each segment, return their number.

    A point splits where its distance from the chord exceeds ``floor`` and ``sigmas`` standard deviations of a point
    across the chord, never taken smaller than that of a range (eq. M10).
    """
    count = 0
    top = 0
    stack[top, 0] = first
    stack[top, 1] = last
    while top >= 0:
        a = stack[top, 0]
        b = stack[top, 1]
        top -= 1
        farthest = farthest_point(xs, ys, a, b, var_range, var_bearing, floor, sigmas)
        if farthest < 0:
            firsts[count] = a
            count += 1
            continue
        # The later half waits below the earlier one, so that segments come out in order.
        top += 1
        stack[top, 0] = farthest
        stack[top, 1] = b
        top += 1
        stack[top, 0] = a
        stack[top, 1] = farthest
    return count


@njit(cache=True, error_model="numpy")
def merge_segments(xs, ys, last, var_range, var_bearing, floor, sigmas, firsts, lasts, count):
    """Join neighbours that are one segment by the rule that splits; fill ``lasts``, return the number that is left.

    A wall parallel to the chord of its cluster is split anywhere along it: all of its points are equally far.
    """
    kept = 0
    lasts[0] = last if count == 1 else firsts[1]
    for k in range(1, count):
        end = last if k == count - 1 else firsts[k + 1]
        # The breaking point itself nearly always shows that the two are not one.
        if (
            exceeds(xs, ys, firsts[kept], end, firsts[k], var_range, var_bearing, floor, sigmas)
            or farthest_point(xs, ys, firsts[kept], end, var_range, var_bearing, floor, sigmas) >= 0
        ):
            kept += 1
            firsts[kept] = firsts[k]
        lasts[kept] = end
    return kept + 1


@njit(cache=True, error_model="numpy")
def drop_stubs(xs, ys, firsts, lasts, count, min_points, min_length):
    """Drop segments too small for a line in place; return the number left and whether each is joined to its successor.

    Noise at a corner splits off a few points that are no wall; the walls on either side of them may still meet there.
    """
    joined = np.zeros(count + 1, np.bool_)
    kept = 0
    for k in range(count):
        connected = k > 0 and lasts[k - 1] == firsts[k]
        if kept > 0 and not connected:
            joined[kept - 1] = False
        a = firsts[k]
        b = lasts[k]
        if b - a + 1 < min_points or math.hypot(xs[b] - xs[a], ys[b] - ys[a]) < min_length:
            continue
        firsts[kept] = firsts[k]
        lasts[kept] = lasts[k]
        joined[kept] = True
        kept += 1
    if kept > 0:
        joined[kept - 1] = False
    return kept, joined


@njit(cache=True, error_model="numpy")
def exceeds(xs, ys, a, b, i, var_range, var_bearing, floor, sigmas):
    """Whether the point i exceeds the threshold of the chord from a to b."""
    chord_x = xs[b] - xs[a]
    chord_y = ys[b] - ys[a]
    length2 = chord_x * chord_x + chord_y * chord_y
    if length2 == 0.0:
        return False
    across2 = (chord_x * ys[i] - chord_y * xs[i]) ** 2 / length2
    rho2 = xs[i] * xs[i] + ys[i] * ys[i]
    variance = max(var_range, var_range * across2 / rho2 + var_bearing * (rho2 - across2))
    distance = chord_x * (ys[i] - ys[a]) - chord_y * (xs[i] - xs[a])
    return distance * distance > length2 * max(floor * floor, sigmas * sigmas * variance)


@njit(cache=True, error_model="numpy")
def farthest_point(xs, ys, a, b, var_range, var_bearing, floor, sigmas):
    """Index between a and b of the point that exceeds the threshold by the largest factor, -1 where none does."""
    x_a = xs[a]
    y_a = ys[a]
    chord_x = xs[b] - x_a
    chord_y = ys[b] - y_a
    length = math.hypot(chord_x, chord_y)
    farthest = -1
    largest = 1.0
    least = max(floor * floor, sigmas * sigmas * var_range)
    if length > 0.0:
        normal_x = -chord_y / length
        normal_y = chord_x / length
        offset = normal_x * x_a + normal_y * y_a
        # Nearly every segment ends here: no point is beyond the lowest threshold, whatever its noise.
        largest2 = largest_distance2(xs, ys, a + 1, b, normal_x, normal_y, offset)
        if not largest2 > least:
            return -1
        for i in range(a + 1, b):
            across = normal_x * xs[i] + normal_y * ys[i]
            distance2 = (across - offset) ** 2
            if distance2 > largest * least:
                rho2 = xs[i] * xs[i] + ys[i] * ys[i]
                variance = var_range * across * across / rho2 + var_bearing * (rho2 - across * across)
                excess = distance2 / max(least, sigmas * sigmas * variance)
                if excess > largest:
                    largest = excess
                    farthest = i
        return farthest
    for i in range(a + 1, b):
        distance2 = (xs[i] - x_a) ** 2 + (ys[i] - y_a) ** 2
        rho2 = xs[i] * xs[i] + ys[i] * ys[i]
        excess = distance2 / max(least, sigmas * sigmas * var_bearing * rho2)
        if excess > largest:
            largest = excess
            farthest = i
    return farthest


@njit(cache=True, error_model="numpy", fastmath=True)
def largest_distance2(xs, ys, a, b, normal_x, normal_y, offset):
    """Return the largest squared distance of the points a..b-1 from a line; fastmath lets it run on vectors."""
    largest = 0.0
    for i in range(a, b):
        distance = normal_x * xs[i] + normal_y * ys[i] - offset
        largest = max(largest, distance * distance)
    return largest


@njit(cache=True, error_model="numpy")
def trim_ends(xs, ys, first, last, points, distance):
    """First and last index of a segment without ``points`` points, and without those within ``distance``, of its ends.

    Noise moves a breaking point along the wall: the points nearest to it belong to neither wall.
    """
    a = min(first + points, last)
    while a < last and (xs[a] - xs[first]) ** 2 + (ys[a] - ys[first]) ** 2 < distance * distance:
        a += 1
    b = max(last - points, first)
    while b > first and (xs[b] - xs[last]) ** 2 + (ys[b] - ys[last]) ** 2 < distance * distance:
        b -= 1
    return a, b


@njit(cache=True, error_model="numpy")
def move_break(xs, ys, angles, position, line_a, line_b, span_a, span_b, accepted, fixed):
    """Return the last point of wall a and the first of wall b, on either side of the bearing of their intersection.

    A point changes sides only if it lies within ``accepted`` of the wall that takes it [m]. Where the break is the end
    of a closed scan (``fixed``) a wall may lose points there but not take any.
    """
    bearing = math.atan2(position[1], position[0])
    begin, last = span_a
    first, end = span_b
    while (
        last > begin
        and is_before(bearing, angles[last])
        and (fixed or distance_from(line_b, xs[last], ys[last]) <= accepted)
    ):
        last -= 1
    while (
        not fixed
        and last + 1 < end
        and not is_before(bearing, angles[last + 1])
        and distance_from(line_a, xs[last + 1], ys[last + 1]) <= accepted
    ):
        last += 1
    while (
        first < end
        and not is_before(bearing, angles[first])
        and (fixed or distance_from(line_a, xs[first], ys[first]) <= accepted)
    ):
        first += 1
    while (
        not fixed
        and first - 1 > begin
        and is_before(bearing, angles[first - 1])
        and distance_from(line_b, xs[first - 1], ys[first - 1]) <= accepted
    ):
        first -= 1
    return last, first


@njit(cache=True, error_model="numpy")
def is_before(bearing, angle):
    """Whether a bearing lies clockwise of an angle that is less than half a turn away."""
    return (bearing - angle + math.pi) % TWO_PI < math.pi


@njit(cache=True, error_model="numpy")
def distance_from(polar_line, x, y):
    """Distance of a point from a polar line [m]."""
    return abs(x * math.cos(polar_line[SLOPE]) + y * math.sin(polar_line[SLOPE]) - polar_line[INTERCEPT])


@njit(cache=True, error_model="numpy")
def step_back(xs, ys, index, limit, position, distance):
    """Step from a point towards ``limit`` until it is ``distance`` away from a position; return where that is."""
    step = 1 if limit > index else -1
    while index != limit and (xs[index] - position[0]) ** 2 + (ys[index] - position[1]) ** 2 < distance * distance:
        index += step
    return index
