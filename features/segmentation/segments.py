# pyright: standard
"""From points to straight segments: jump-distance clusters, split by iterative end point fit (IEPF)."""

import math

import numpy as np

from features.compiled import inner
from features.se2 import TWO_PI

PLACE_BITS = (1 << 24) - 1
"""Mask of the low bits of a double where :func:`farthest_point` keeps the index of a point; no scan has so many."""

ONE_BITS = int(np.float64(1.0).view(np.int64))

SEGMENT_RECORD = np.dtype(
    [
        ("first", np.int64),
        ("last", np.int64),
        ("begin", np.int64),
        ("end", np.int64),
        ("joined", np.int64),
        ("line", np.int64),
        ("normal_x", np.float64),
        ("normal_y", np.float64),
        ("offset", np.float64),
        ("bend", np.float64),
    ]
)
"""A segment while a scan is processed.

``first`` and ``last`` are its breaking points, ``begin`` and ``end`` the points that are fitted, ``joined`` says
whether the next segment continues it, ``line`` is the index of its line or -1; ``normal . p = offset`` is its
total-least-squares line, and ``bend`` is how far its ends may bend away from a line [m].
"""


@inner()
def find_jumps(xs, ys, ranges, angles, n, slack, jump_angle, largest_gap, jumps):
    """Mark each of the n points behind which a segment ends, the last against the first; True where there is none.

    The allowed jump follows a wall that is seen at ``jump_angle`` or steeper (Borges and Aldon 2004): it grows with the
    range and with the angle between the beams, by ``slack`` for the noise; a gap of more than ``largest_gap`` always
    ends a segment (eq. M9).
    """
    # What follows the last point is the first one, a turn later.
    xs[n] = xs[0]
    ys[n] = ys[0]
    ranges[n] = ranges[0]
    angles[n] = angles[0] + TWO_PI
    per_cross = 1.0 / math.sin(jump_angle)
    found = 0
    for i in range(n):
        # The far point lies near sin(gap) / sin(jump_angle) away where the beam meets the wall at jump_angle: the
        # allowed jump is the shorter range times that and the slack, here times the longer range.
        longer = ranges[i] if ranges[i] > ranges[i + 1] else ranges[i + 1]
        limit = (xs[i] * ys[i + 1] - ys[i] * xs[i + 1]) * per_cross + slack * longer
        jump2 = (xs[i + 1] - xs[i]) ** 2 + (ys[i + 1] - ys[i]) ** 2
        gap = angles[i + 1] - angles[i]
        jump = (gap > largest_gap) | (gap >= math.pi) | (jump2 * longer * longer > limit * limit)
        jumps[i] = jump
        found += jump
    return found == 0


@inner()
def find_segments(xs, ys, jumps, total, var_range, var_bearing, rules, stack, segments):
    """Split each cluster of the points 0..total-1 into segments; return their number."""
    count = 0
    begin = 0
    for i in range(total):
        if jumps[i] == 0:
            continue
        # A segment of fewer points is no line, and its neighbours have no corner with it.
        if i - begin + 1 >= rules.min_points:
            found = segments[count:]
            added = split_segments(xs, ys, begin, i, var_range, var_bearing, rules, stack, found)
            kept = merge_segments(xs, ys, added, var_range, var_bearing, rules, found) if rules.tested else added
            for k in range(kept):
                found[k].joined = k + 1 < kept
            count += kept
        begin = i + 1
    return drop_stubs(xs, ys, var_range, rules, segments, count)


@inner()
def split_segments(xs, ys, first, last, var_range, var_bearing, rules, stack, segments):
    """Split the points first..last by IEPF; fill the first and the last point of each segment, return their number.

    A point splits where its distance from the chord exceeds a floor and some standard deviations of a point across the
    chord, never taken smaller than that of a range (eq. M10).
    """
    count = 0
    waiting = 1
    stack[0] = last
    a = first
    while waiting > 0:
        b = stack[waiting - 1]
        farthest = farthest_point(xs, ys, a, b, var_range, var_bearing, rules)
        if farthest < 0:
            segments[count].first = a
            segments[count].last = b
            count += 1
            waiting -= 1
            a = b
        else:
            # The later half waits.
            stack[waiting] = farthest
            waiting += 1
    return count


@inner()
def merge_segments(xs, ys, count, var_range, var_bearing, rules, segments):
    """Join neighbours that are one segment by the rule that splits, in place; return the number that is left.

    A wall parallel to the chord of its cluster is split anywhere along it: all of its points are equally far.
    """
    kept = 0
    for k in range(1, count):
        a = segments[kept].first
        joint = segments[k].first
        b = segments[k].last
        # The breaking point itself nearly always shows that the two are not one.
        if (
            exceeds(xs, ys, a, b, joint, var_range, var_bearing, rules)
            or farthest_point(xs, ys, a, b, var_range, var_bearing, rules) >= 0
        ):
            kept += 1
            segments[kept].first = joint
        segments[kept].last = b
    return kept + 1


@inner()
def drop_stubs(xs, ys, var_range, rules, segments, count):
    """Drop segments too small for a line, in place; return the number left.

    Noise at a corner splits off a few points that are no wall; the walls on either side of them may still meet there:
    what is left is joined to the next if all that was dropped between them was.
    """
    kept = 0
    before_first = 1
    for k in range(count):
        a = segments[k].first
        b = segments[k].last
        few = b - a + 1 < rules.min_points + 2 * rules.trim_points
        if few or is_short(xs[b] - xs[a], ys[b] - ys[a], var_range, rules):
            if kept > 0:
                segments[kept - 1].joined &= segments[k].joined
            else:
                before_first &= segments[k].joined
            continue
        segments[kept].first = a
        segments[kept].last = b
        segments[kept].joined = segments[k].joined
        kept += 1
    if kept > 0:
        segments[kept - 1].joined &= before_first
    return kept


@inner(forceinline=True)
def is_short(x, y, var_range, rules):
    """Whether the way from end to end is too short for a line, as noise leaves it no direction."""
    return x * x + y * y < min(rules.min_length**2, rules.min_length_sigmas**2 * var_range)


@inner()
def exceeds(xs, ys, a, b, i, var_range, var_bearing, rules):
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
    return distance * distance > length2 * max(rules.split_distance**2, rules.split_sigmas**2 * variance)


@inner()
def farthest_point(xs, ys, a, b, var_range, var_bearing, rules):
    """Index between a and b of the point that exceeds the threshold by the largest factor, -1 where none does."""
    sigmas2 = rules.split_sigmas * rules.split_sigmas
    least = max(rules.split_distance * rules.split_distance, sigmas2 * var_range)
    xs = xs[a : b + 1]
    ys = ys[a : b + 1]
    chord_x = xs[-1] - xs[0]
    chord_y = ys[-1] - ys[0]
    length2 = chord_x * chord_x + chord_y * chord_y
    normal_x = normal_y = offset = 0.0
    if length2 > 0.0:
        per_length = 1.0 / math.sqrt(length2)
        normal_x = -chord_y * per_length
        normal_y = chord_x * per_length
        offset = normal_x * xs[0] + normal_y * ys[0]
        # Nearly every segment ends here: no point is beyond the lowest threshold, whatever its noise.
        if not any_beyond(xs, ys, normal_x, normal_y, offset, least):
            return -1
    # The low bits of a factor hold the index of its point. A positive double orders as the integer of its bits does, so
    # that one vectorised maximum finds both; of points that are equally far it finds the first.
    best = ONE_BITS | PLACE_BITS
    for i in range(xs.size):
        rho2 = xs[i] * xs[i] + ys[i] * ys[i]
        across = normal_x * xs[i] + normal_y * ys[i]
        distance2 = (across - offset) ** 2 if length2 > 0.0 else (xs[i] - xs[0]) ** 2 + (ys[i] - ys[0]) ** 2
        variance = var_range * across * across + var_bearing * (rho2 - across * across) * rho2
        beyond_floor = least * rho2
        beyond_noise = sigmas2 * variance
        threshold = beyond_noise if beyond_noise > beyond_floor else beyond_floor
        factor = np.float64(distance2 * rho2 / threshold).view(np.int64)
        candidate = (factor & ~PLACE_BITS) | (PLACE_BITS - i)
        best = candidate if candidate > best else best
    return -1 if best == ONE_BITS | PLACE_BITS else a + PLACE_BITS - (best & PLACE_BITS)


@inner()
def any_beyond(xs, ys, normal_x, normal_y, offset, distance2):
    """Whether one of the points is farther from a line; counted, so that the compiler runs it on vectors."""
    beyond = 0
    for i in range(xs.size):
        distance = normal_x * xs[i] + normal_y * ys[i] - offset
        beyond += distance * distance > distance2
    return beyond > 0
