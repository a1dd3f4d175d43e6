"""The beams of one scan, sorted into sectors of the turn, and the walls laid on them."""

import math

import numpy as np

from features.compiled import inner

BEAMS_PER_SECTOR = 4
"""In a full turn, on average: with more, more beams are tried in vain at the ends of walls; with fewer, there are more
sectors to sort into."""

MAX_SECTORS = 4096

BLOCK = 8
"""Beams that stand next to each other once sorted and share one entry for the farthest of them; a power of two."""

_WHOLE = ~np.uint64(BLOCK - 1)
"""Mask that rounds a slot down to the first one of its block."""

_MARGIN = 1e-6
"""Widens what a wall or box covers, so that rounding never keeps a beam from being tried [turns]."""

SLACK = 1.0 - 1e-9
"""What is nearer than this share of its squared distance allows is not hidden by rounding alone."""


@inner()
def sector_count(beams):
    """Sectors, a power of two, for this many beams."""
    sectors = 16
    while sectors * BEAMS_PER_SECTOR < beams and sectors < MAX_SECTORS:
        sectors *= 2
    return sectors


@inner()
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


@inner()
def wall_sectors(ax, ay, bx, by, sectors):
    """First and last sector, counter-clockwise, of the wall from a to b as seen from the origin."""
    turn_a, turn_b = _turn(ax, ay), _turn(bx, by)
    if ax * by < ay * bx:
        turn_a, turn_b = turn_b, turn_a
    return _sector(turn_a - _MARGIN, sectors), _sector(turn_b + _MARGIN, sectors)


@inner()
def box_sectors(x_min, y_min, x_max, y_max, sectors):
    """First and last sector, counter-clockwise, of a box that does not hold the origin: those of its outer corners."""
    left, right = x_max < 0.0, x_min > 0.0
    below, above = y_max < 0.0, y_min > 0.0
    ax = x_max if above or (left and not below) else x_min
    ay = y_min if right or (above and not left) else y_max
    bx = x_min if above or (right and not below) else x_max
    by = y_max if right or (below and not left) else y_min
    return _sector(_turn(ax, ay) - _MARGIN, sectors), _sector(_turn(bx, by) + _MARGIN, sectors)


@inner()
def hidden(firsts, far, first, last, distance):
    """Whether no beam from the first sector to the last reaches a squared distance [m^2]."""
    if first > last:
        if not _hidden_slots(far, firsts[first], firsts[firsts.size - 2], distance):
            return False
        first = np.uint32(0)
    return _hidden_slots(far, firsts[first], firsts[last + np.uint32(1)], distance)


@inner()
def _hidden_slots(far, begin, end, distance):
    """Whether no beam in the slots ``begin <= k < end`` reaches a squared distance [m^2]."""
    if begin == end:
        return True
    first, last = _blocks(begin, end)
    for block in range(first, last):  # noqa: SIM110, all() does not compile
        if far[block] >= distance * SLACK:
            return False
    return True


@inner()
def _blocks(begin, end):
    """First block of the slots ``begin <= k < end``, and the one after their last; unsigned, as indices of loops."""
    return np.uint64(begin) // np.uint64(BLOCK), (np.uint64(end) + np.uint64(BLOCK - 1)) // np.uint64(BLOCK)


@inner()
def lay(cosines, sines, ranges, hits, far, begin, end, ax, ay, bx, by, wall):
    """Try a wall on all beams of the blocks that hold the slots ``begin <= k < end``, and keep what is nearer.

    ``far`` holds the squared range of the farthest beam of each block [m^2]. Unsigned indices, no branch and a whole
    number of blocks: so the compiler makes vector code of the loop, with little left over.
    """
    for i in range(np.uint64(begin) & _WHOLE, (np.uint64(end) + np.uint64(BLOCK - 1)) & _WHOLE):
        hit = hit_range(cosines[i], sines[i], ax, ay, bx, by)
        before, other = ranges[i], hits[i]
        nearer = (hit < before) | ((hit == before) & (wall < other))
        ranges[i] = hit if nearer else before
        hits[i] = wall if nearer else other
    first, last = _blocks(begin, end)
    for block in range(first, last):
        farthest = -1.0
        for k in range(BLOCK):
            each = ranges[block * np.uint64(BLOCK) + np.uint64(k)]
            farthest = each if each > farthest else farthest
        far[block] = farthest * farthest


@inner()
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


@inner()
def _turn(x, y):
    """Direction of (x, y) as a share of the turn, from -y on, 0 to 1; of the square |x| + |y| = 1, not of a circle.

    It grows with the angle, which is all that sorting needs, at the price of one division.
    """
    height = y / (abs(x) + abs(y))
    return 0.25 * (1.0 + height if x >= 0.0 else 3.0 - height)


@inner()
def _sector(turn, sectors):
    return np.uint32(np.int32(math.floor(turn * sectors)) & (sectors - 1))
