"""From beams to straight segments: jump-distance clusters, split by iterative end point fit (IEPF)."""

import math

import numpy as np
from numba import njit

from features.se2 import TWO_PI


@njit(cache=True)
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
            return np.arange(n), angles.copy()
        if falling:
            return np.arange(n)[::-1].copy(), angles[::-1].copy()
    wrapped = angles % TWO_PI
    order = np.argsort(wrapped, kind="mergesort")
    return order, wrapped[order]


@njit(cache=True)
def mean_spacing(angles):
    """Mean angle between neighbouring beams, rising over at most one turn, across the arc that they cover [rad]."""
    n = angles.size
    if n < 2:
        return 0.0
    largest = angles[0] - angles[n - 1] + TWO_PI
    for i in range(1, n):
        largest = max(largest, angles[i] - angles[i - 1])
    return (TWO_PI - largest) / (n - 1)


@njit(cache=True)
def find_jumps(ranges, angles, sigma_range, sigmas, jump_angle, largest_gap):
    """Mark each point behind which a segment ends, shape (n,), the last against the first across the end of the scan.

    The allowed jump follows a wall that is seen at ``jump_angle`` or steeper (Borges and Aldon 2004): it grows with the
    range and with the angle between the beams; a gap of more than ``largest_gap`` always ends a segment (eq. M9).
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


@njit(cache=True)
def merge_segments(xs, ys, last, var_range, var_bearing, floor, sigmas, firsts, lasts, count):
    """Join neighbours that are one segment by the rule that splits; fill ``lasts``, return the number that is left.

    A wall parallel to the chord of its cluster is split anywhere along it: all of its points are equally far.
    """
    kept = 0
    lasts[0] = last if count == 1 else firsts[1]
    for k in range(1, count):
        end = last if k == count - 1 else firsts[k + 1]
        if farthest_point(xs, ys, firsts[kept], end, var_range, var_bearing, floor, sigmas) >= 0:
            kept += 1
            firsts[kept] = firsts[k]
        lasts[kept] = end
    return kept + 1


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
