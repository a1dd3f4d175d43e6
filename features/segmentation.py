"""From beams to straight segments: jump-distance clusters, split by iterative end point fit (IEPF)."""

import math

import numpy as np
from numba import njit

TWO_PI = 2.0 * math.pi


@njit(cache=True)
def order_returns(ranges, angles, range_min, range_max):
    """Return the indices of the beams with a return, counter-clockwise."""
    n = ranges.size
    beams = np.empty(n, np.int64)
    count = 0
    for i in range(n):
        if range_min <= ranges[i] <= range_max:
            beams[count] = i
            count += 1
    beams = beams[:count]
    if count < 2:
        return beams
    rising = True
    falling = True
    for k in range(1, count):
        step = angles[beams[k]] - angles[beams[k - 1]]
        rising = rising and step >= 0.0
        falling = falling and step <= 0.0
    if falling:
        beams = beams[::-1].copy()
    if not (rising or falling) or abs(angles[beams[count - 1]] - angles[beams[0]]) >= TWO_PI:
        return beams[np.argsort(angles[beams] % TWO_PI, kind="mergesort")]
    return beams


@njit(cache=True)
def find_jumps(ranges, angles, sigma_range, sigmas, jump_angle, largest_gap):
    """Mark each point behind which a segment ends, shape (n,), the last against the first across the end of the scan.

    The allowed jump follows a wall that is seen at ``jump_angle`` or steeper (Borges and Aldon 2004): it grows with the
    range and with the angle between the beams; a gap of more than ``largest_gap`` always ends a segment.
    """
    n = ranges.size
    jumps = np.empty(n, np.bool_)
    for i in range(n):
        k = (i + 1) % n
        gap = angles[k] - angles[i]
        if k == 0:
            gap += TWO_PI
        if gap > largest_gap or gap >= jump_angle:
            jumps[i] = True
            continue
        near = min(ranges[i], ranges[k])
        limit = near * math.sin(gap) / math.sin(jump_angle - gap) + sigmas * sigma_range
        # Law of cosines in the form that keeps its digits for small gaps.
        distance2 = (ranges[k] - ranges[i]) ** 2 + 4.0 * ranges[k] * ranges[i] * math.sin(0.5 * gap) ** 2
        jumps[i] = distance2 > limit * limit
    return jumps


@njit(cache=True)
def split_segments(xs, ys, first, last, var_range, var_bearing, floor, sigmas, stack, breaks, count):
    """Split the points first..last by IEPF; append the first index of each segment to ``breaks``, return the new count.

    A point splits where its distance from the chord exceeds ``floor`` and ``sigmas`` standard deviations of a point
    across the chord, never taken smaller than that of a range.
    """
    top = 0
    stack[top, 0] = first
    stack[top, 1] = last
    while top >= 0:
        a = stack[top, 0]
        b = stack[top, 1]
        top -= 1
        farthest = farthest_point(xs, ys, a, b, var_range, var_bearing, floor, sigmas)
        if farthest < 0:
            breaks[count] = a
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


@njit(cache=True)
def farthest_point(xs, ys, a, b, var_range, var_bearing, floor, sigmas):
    """Index between a and b of the point that exceeds the threshold by the largest factor, -1 where none does."""
    chord_x = xs[b] - xs[a]
    chord_y = ys[b] - ys[a]
    length = math.hypot(chord_x, chord_y)
    farthest = -1
    largest = 1.0
    for i in range(a + 1, b):
        x = xs[i] - xs[a]
        y = ys[i] - ys[a]
        rho2 = xs[i] * xs[i] + ys[i] * ys[i]
        if length > 0.0:
            distance2 = ((chord_x * y - chord_y * x) / length) ** 2
            across = (chord_x * ys[i] - chord_y * xs[i]) / length
            along2 = rho2 - across * across
            variance = max(var_range, var_range * across * across / rho2 + var_bearing * along2)
        else:
            distance2 = x * x + y * y
            variance = max(var_range, var_bearing * rho2)
        excess = distance2 / max(floor * floor, sigmas * sigmas * variance)
        if excess > largest:
            largest = excess
            farthest = i
    return farthest


@njit(cache=True)
def trim_ends(xs, ys, first, last, points, distance):
    """First and last index of a segment without ``points`` points, and without those within ``distance``, of its ends.

    Noise moves a breaking point along the wall: the points nearest to it belong to neither wall.
    """
    a = min(first + points, last)
    while a < last and math.hypot(xs[a] - xs[first], ys[a] - ys[first]) < distance:
        a += 1
    b = max(last - points, first)
    while b > first and math.hypot(xs[b] - xs[last], ys[b] - ys[last]) < distance:
        b -= 1
    return a, b
