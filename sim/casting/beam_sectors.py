# pyright: standard
"""The beams of one scan, sorted into sectors of the full turn, and the walls that they hit."""

import math

import numpy as np

from features.compiled import inner

BEAMS_PER_SECTOR = 4
"""Average number of beams in a sector: with more, more beams beyond the ends of a wall are tried in vain; with fewer,
there are more sectors to sort into."""

MAX_SECTORS = 4096
"""Bound of the table of sectors, which is cleared for each scan; it suffices for 16,384 beams in a full turn."""

BLOCK = 8
"""Consecutive sorted beams that share one entry for the farthest of them: as many as fill one or two vector registers
with doubles; a power of two."""

_WHOLE = ~np.uint64(BLOCK - 1)
"""Mask that rounds a slot down to the first one of its block."""

_MARGIN = 1e-6
"""The sectors of a wall or box are widened by this, so that rounding never excludes a beam that hits it [turns]."""

SLACK = 1.0 - 1e-9
"""Factor on a squared distance before it is compared with squared ranges, so that rounding alone never hides a wall."""


@inner()
def sector_count(beams):
    """Return the number of sectors, a power of two, for this many beams."""
    sectors = 16
    while sectors * BEAMS_PER_SECTOR < beams and sectors < MAX_SECTORS:
        sectors *= 2
    return sectors


@inner()
def sort_beams(cosines, sines, sorted_cosines, sorted_sines, slots, firsts):
    """Sort beams by sector with a counting sort, which keeps their order within a sector.

    It fills ``sorted_cosines``, ``sorted_sines``, ``slots`` with the sorted place of each beam, shape (n,), and
    ``firsts`` with the first slot of each sector, shape (sectors + 2,); the last but one entry ends the last sector.
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
    """Return the first and last sector, counter-clockwise, that the wall from a to b covers as seen from the origin."""
    turn_a, turn_b = _turn(ax, ay), _turn(bx, by)
    if ax * by < ay * bx:
        turn_a, turn_b = turn_b, turn_a
    return _sector(turn_a - _MARGIN, sectors), _sector(turn_b + _MARGIN, sectors)


@inner()
def box_sectors(x_min, y_min, x_max, y_max, sectors):
    """Return the first and last sector, counter-clockwise, that a box covers which does not contain the origin.

    They are the sectors of the two corners of its silhouette.
    """
    left, right = x_max < 0.0, x_min > 0.0
    below, above = y_max < 0.0, y_min > 0.0
    ax = x_max if above or (left and not below) else x_min
    ay = y_min if right or (above and not left) else y_max
    bx = x_min if above or (right and not below) else x_max
    by = y_max if right or (below and not left) else y_min
    return _sector(_turn(ax, ay) - _MARGIN, sectors), _sector(_turn(bx, by) + _MARGIN, sectors)


@inner()
def hidden(firsts, far, first, last, distance):
    """Whether all beams from the first sector to the last end before a squared distance [m^2]."""
    if first > last:
        if not _hidden_slots(far, firsts[first], firsts[firsts.size - 2], distance):
            return False
        first = np.uint32(0)
    return _hidden_slots(far, firsts[first], firsts[last + np.uint32(1)], distance)


@inner()
def _hidden_slots(far, begin, end, distance):
    """Whether all beams in the slots ``begin <= k < end`` end before a squared distance [m^2]."""
    if begin == end:
        return True
    first, last = _blocks(begin, end)
    for block in range(first, last):  # noqa: SIM110, all() does not compile
        if far[block] >= distance * SLACK:
            return False
    return True


@inner()
def _blocks(begin, end):
    """Return the first block of the slots ``begin <= k < end`` and the one after the last; unsigned to index loops."""
    return np.uint64(begin) // np.uint64(BLOCK), (np.uint64(end) + np.uint64(BLOCK - 1)) // np.uint64(BLOCK)


@inner()
def try_wall(cosines, sines, ranges, hits, far, begin, end, ax, ay, bx, by, wall):
    """Intersect a wall with the beams of the blocks that contain the slots ``begin <= k < end``; keep the nearer hits.

    It updates ``ranges`` [m], ``hits`` (numbers of walls), and ``far``, the squared range of the farthest beam of each
    block [m^2]. Indices are unsigned, the loop has no branch and covers whole blocks, so that the compiler makes vector
    code of it with little remainder.
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
    """Return the range at which a beam from the origin in direction (c, s) hits the wall from a to b [m]; else inf."""
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
    """Return the direction of (x, y) as a fraction of the turn, counter-clockwise from -y, 0 to 1.

    The fraction is measured along the square |x| + |y| = 1 instead of a circle: it grows with the angle, which is all
    that sorting needs, and costs one division.
    """
    height = y / (abs(x) + abs(y))
    return 0.25 * (1.0 + height if x >= 0.0 else 3.0 - height)


@inner()
def _sector(turn, sectors):
    return np.uint32(np.int32(math.floor(turn * sectors)) & (sectors - 1))
