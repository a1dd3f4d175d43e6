# pyright: standard
"""From a scan's beams to points in counter-clockwise order."""

import math

import numpy as np

from features.compiled import inner
from features.returns import is_return
from features.se2 import TWO_PI

TURN_BITS = 30
"""Bits behind the binary point of QUARTER_HIGH: so few that its small multiples are exact."""

QUARTER_HIGH = math.ldexp(round(math.ldexp(math.pi / 2.0, TURN_BITS)), -TURN_BITS)
QUARTER_LOW = math.pi / 2.0 - QUARTER_HIGH
QUARTER_REST = 6.123233995736766e-17
"""The remainder of pi / 2 beyond the two doubles above."""

S3, S5, S7, S9, S11, S13, S15 = ((-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 8))
C2, C4, C6, C8, C10, C12, C14, C16 = ((-1.0) ** k / math.factorial(2 * k) for k in range(1, 9))
"""Taylor coefficients of sine and cosine; up to pi / 4 the terms left out are below 1e-16."""


@inner()
def turn_of(angles):
    """Return 1 where the angles rise, or stay, through at most one turn, -1 where they fall, and else 0."""
    falls = 0
    rises = 0
    for i in range(1, angles.size):
        falls += angles[i] < angles[i - 1]
        rises += angles[i] > angles[i - 1]
    if (falls > 0 and rises > 0) or abs(angles[angles.size - 1] - angles[0]) >= TWO_PI:
        return 0
    return 1 if falls == 0 else -1


@inner()
def gather_returns(scan_ranges, scan_angles, range_min, range_max, ranges, angles, beams):
    """Fill range, angle and index of the beams with a return, counter-clockwise through at most one turn.

    Returns their number and the mean angle between neighbouring beams, returned or not, across the arc that they cover.
    """
    size = scan_angles.size
    turn = turn_of(scan_angles)
    order = np.empty(0, np.int64)
    # A second time where rounding makes a whole turn of an angle just below zero.
    while turn == 0:
        wrapped = scan_angles % TWO_PI
        rising = np.argsort(wrapped, kind="mergesort")
        scan_ranges = scan_ranges[rising]
        scan_angles = wrapped[rising]
        order = order[rising] if order.size > 0 else rising
        turn = turn_of(scan_angles)
    # Whole turns are taken off, so that sine and cosine see small angles.
    whole_turns = TWO_PI * np.rint(scan_angles[0] / TWO_PI)
    beam = 0 if turn > 0 else size - 1
    previous = scan_angles[beam]
    largest_step = TWO_PI - abs(scan_angles[size - 1] - scan_angles[0])
    n = 0
    for _ in range(size):
        angle = scan_angles[beam]
        largest_step = max(largest_step, angle - previous)
        previous = angle
        ranges[n] = scan_ranges[beam]
        angles[n] = angle - whole_turns
        beams[n] = beam
        n += is_return(scan_ranges[beam], range_min, range_max)
        beam += turn
    if order.size > 0:
        for i in range(n):
            beams[i] = order[beams[i]]
    return n, (TWO_PI - largest_step) / max(size - 1, 1)


@inner(fastmath={"contract"}, forceinline=True)
def to_cartesian(ranges, angles, n, xs, ys):
    """Fill x and y of n points whose angles lie within a few turns.

    Sine and cosine by reduction to an eighth of a turn and their series: without branch or call, so that the compiler
    runs it on vectors.
    """
    for i in range(n):
        quarters = np.rint(angles[i] * (2.0 / math.pi))
        t = ((angles[i] - quarters * QUARTER_HIGH) - quarters * QUARTER_LOW) - quarters * QUARTER_REST
        t2 = t * t
        sine = t + t * t2 * (S3 + t2 * (S5 + t2 * (S7 + t2 * (S9 + t2 * (S11 + t2 * (S13 + t2 * S15))))))
        cosine = 1.0 + t2 * (C2 + t2 * (C4 + t2 * (C6 + t2 * (C8 + t2 * (C10 + t2 * (C12 + t2 * (C14 + t2 * C16)))))))
        quadrant = quarters - 4.0 * np.floor(quarters * 0.25)
        odd = (quadrant == 1.0) | (quadrant == 3.0)
        x = sine if odd else cosine
        y = cosine if odd else sine
        xs[i] = -ranges[i] * x if (quadrant == 1.0) | (quadrant == 2.0) else ranges[i] * x
        ys[i] = -ranges[i] * y if quadrant >= 2.0 else ranges[i] * y
