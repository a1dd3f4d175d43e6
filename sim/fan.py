"""The beams of one scan, sorted into equal sectors of the turn, and what the nearest walls so far are."""

import math

import numba
import numpy as np

BEAMS_PER_SECTOR = 4
"""Of a full turn of beams, on average: more are tried in vain at the ends of walls, fewer need more sectors."""

MAX_SECTORS = 4096

_MARGIN = 1e-6
"""Widens what a wall or box covers, so that rounding never keeps a beam from being tried [turns]."""

SLACK = 1.0 - 1e-9
"""What is nearer than this share of its squared distance allows is not hidden by rounding alone."""


@numba.njit(cache=True, error_model="numpy")
def sector_count(beams):
    """Sectors, a power of two, for this many beams."""
    sectors = 16
    while sectors * BEAMS_PER_SECTOR < beams and sectors < MAX_SECTORS:
        sectors *= 2
    return sectors


@numba.njit(cache=True, error_model="numpy")
def sort_beams(cosines, sines, sorted_cosines, sorted_sines, slots, firsts):
    """Sort beams by sector, by counting, and keep their order within one.

    Fills ``sorted_cosines``, ``sorted_sines``, the slot that each beam went to, shape (n,), and the first slot of each
    sector, shape (sectors + 2,); the last but one ends the last sector.
    """
    sectors = firsts.size - 2
    for i in range(slots.size):
        slots[i] = _sector(_turn(cosines[i], sines[i]), sectors)
    firsts[:] = 0
    for i in range(slots.size):
        firsts[slots[i] + np.uint32(2)] += np.uint32(1)
    total = np.uint32(0)
    for k in range(firsts.size):
        total += firsts[k]
        firsts[k] = total
    for i in range(slots.size):
        sector = slots[i] + np.uint32(1)
        slot = firsts[sector]
        firsts[sector] = slot + np.uint32(1)
        slots[i] = slot
        sorted_cosines[slot] = cosines[i]
        sorted_sines[slot] = sines[i]


@numba.njit(cache=True, error_model="numpy")
def wall_sectors(ax, ay, bx, by, sectors):
    """First and last sector, counter-clockwise, of the wall from a to b as seen from the origin."""
    turn_a, turn_b = _turn(ax, ay), _turn(bx, by)
    if ax * by < ay * bx:
        turn_a, turn_b = turn_b, turn_a
    return _sector(turn_a - _MARGIN, sectors), _sector(turn_b + _MARGIN, sectors)


@numba.njit(cache=True, error_model="numpy")
def box_sectors(x_min, y_min, x_max, y_max, sectors):
    """First and last sector, counter-clockwise, of a box that does not hold the origin: those of its outer corners."""
    left, right = x_max < 0.0, x_min > 0.0
    below, above = y_max < 0.0, y_min > 0.0
    ax = x_max if above or (left and not below) else x_min
    ay = y_min if right or (above and not left) else y_max
    bx = x_min if above or (right and not below) else x_max
    by = y_max if right or (below and not left) else y_min
    return _sector(_turn(ax, ay) - _MARGIN, sectors), _sector(_turn(bx, by) + _MARGIN, sectors)


@numba.njit(cache=True, error_model="numpy")
def hidden(far, first, last, distance):
    """Whether no beam from the first sector to the last reaches a squared distance [m^2]."""
    nearest = distance * SLACK
    if first > last:
        for k in range(np.uint64(first), np.uint64(far.size)):
            if far[k] >= nearest:
                return False
        first = np.uint32(0)
    for k in range(np.uint64(first), np.uint64(last) + np.uint64(1)):
        if far[k] >= nearest:
            return False
    return True


@numba.njit(cache=True, error_model="numpy")
def lay(cosines, sines, ranges, hits, firsts, far, first, last, ax, ay, bx, by, wall):
    """Try a wall on the beams from the first sector to the last, ``first <= last``, and keep what is nearer.

    Whether a beam hits is decided by the sides on which the wall's ends lie of it, and the hit is a point between them.
    Unsigned indices and no branch: so the compiler makes vector code of the loop.
    """
    for i in range(np.uint64(firsts[first]), np.uint64(firsts[last + np.uint32(1)])):
        hit = hit_range(cosines[i], sines[i], ax, ay, bx, by)
        before, other = ranges[i], hits[i]
        nearer = (hit < before) | ((hit == before) & (wall < other))
        ranges[i] = hit if nearer else before
        hits[i] = wall if nearer else other
    for k in range(np.uint64(first), np.uint64(last) + np.uint64(1)):
        farthest = -1.0
        for i in range(np.uint64(firsts[k]), np.uint64(firsts[k + np.uint64(1)])):
            farthest = ranges[i] if ranges[i] > farthest else farthest
        far[k] = farthest * abs(farthest)


@numba.njit(cache=True, error_model="numpy")
def hit_range(c, s, ax, ay, bx, by):
    """Range at which a beam from the origin in direction (c, s) hits the wall from a to b [m]; inf if it does not."""
    side_a, side_b = c * ay - s * ax, c * by - s * bx
    along_a, along_b = c * ax + s * ay, c * bx + s * by
    share = side_a / (side_a - side_b)
    hit = (1.0 - share) * along_a + share * along_b
    nearer_end = along_a if along_a < along_b else along_b
    hit = nearer_end if side_a == side_b else hit
    crosses = ((side_a >= 0.0) & (side_b <= 0.0)) | ((side_a <= 0.0) & (side_b >= 0.0))
    return hit if crosses & (hit > 0.0) else np.inf


@numba.njit(cache=True, error_model="numpy")
def _turn(x, y):
    """Direction of (x, y) as a share of the turn, from -y on, 0 to 1: that of the square |x| + |y| = 1, not of a circle.

    It grows with the angle, which is all that sorting needs, at the price of one division.
    """
    height = y / (abs(x) + abs(y))
    return 0.25 * (1.0 + height if x >= 0.0 else 3.0 - height)


@numba.njit(cache=True, error_model="numpy")
def _sector(turn, sectors):
    return np.uint32(np.int32(math.floor(turn * sectors)) & (sectors - 1))
