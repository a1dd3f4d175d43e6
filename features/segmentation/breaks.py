# pyright: standard
"""The breaks between segments: which points belong to which of two walls, or to neither."""

import math

from features.compiled import inner
from features.fitting.fit_kernels import moments


@inner()
def trim_ends(xs, ys, segment, points, distance):
    """Leave out ``points`` points, and those within ``distance``, of either end of a segment.

    Noise moves a breaking point along the wall: the points nearest to it belong to neither wall.
    """
    first = segment.first
    last = segment.last
    a = min(first + points, last)
    while a < last and (xs[a] - xs[first]) ** 2 + (ys[a] - ys[first]) ** 2 < distance * distance:
        a += 1
    b = max(last - points, first)
    while b > first and (xs[b] - xs[last]) ** 2 + (ys[b] - ys[last]) ** 2 < distance * distance:
        b -= 1
    segment.begin = a
    segment.end = b


@inner(forceinline=True)
def fit_rough(xs, ys, segment):
    """Fit the points of a segment by total least squares, eq. 16-17, without angles and covariance.

    Of fewer than two points there is no line: its normal is zero.
    """
    if segment.end <= segment.begin:
        segment.normal_x = segment.normal_y = segment.offset = 0.0
        return
    mean_x, mean_y, spread_x, spread_y, joint = moments(
        xs[segment.begin : segment.end + 1], ys[segment.begin : segment.end + 1]
    )
    difference = spread_x - spread_y
    size = math.sqrt(difference * difference + 4.0 * joint * joint)
    # Half of the direction's doubled angle; of its two forms the one that does not cancel.
    along_x = 1.0
    along_y = 0.0
    if size > 0.0 and difference >= 0.0:
        along_x = math.sqrt(0.5 * (1.0 + difference / size))
        along_y = joint / (size * along_x)
    elif size > 0.0:
        along_y = math.sqrt(0.5 * (1.0 - difference / size))
        along_x = joint / (size * along_y)
    segment.normal_x = -along_y
    segment.normal_y = along_x
    segment.offset = mean_y * along_x - mean_x * along_y


@inner()
def meet_at(xs, ys, total, segment_a, segment_b, sigma_range, closing, rules):
    """Move the break between two neighbours to where their walls meet (eq. M25).

    They stay joined if both reach that point and all points between them are of one or the other: what was too short
    for a line may be noise at a corner, or a wall that stands between. ``closing`` says that the break is the end of a
    closed scan, whose points are ``total``.
    """
    determinant = segment_a.normal_x * segment_b.normal_y - segment_a.normal_y * segment_b.normal_x
    if determinant == 0.0:
        return
    x = (segment_a.offset * segment_b.normal_y - segment_b.offset * segment_a.normal_y) / determinant
    y = (segment_b.offset * segment_a.normal_x - segment_a.offset * segment_b.normal_x) / determinant
    accepted = max(rules.split_distance, rules.split_sigmas * sigma_range)
    last, first = move_break(xs, ys, x, y, segment_a, segment_b, accepted, closing)
    segment_a.joined = walls_meet(xs, ys, last, first, x, y, rules.corner_gap) and (
        are_near(xs, ys, last + 1, total if closing else first, segment_a, segment_b, accepted)
        and are_near(xs, ys, 0, first if closing else 0, segment_a, segment_b, accepted)
    )
    if segment_a.joined:
        segment_a.last = last
        segment_b.first = first
        trim = rules.trim_sigmas * sigma_range
        segment_a.end = step_back(xs, ys, last - rules.trim_points, segment_a.begin, x, y, trim)
        segment_b.begin = step_back(xs, ys, first + rules.trim_points, segment_b.end, x, y, trim)


@inner()
def move_break(xs, ys, x, y, segment_a, segment_b, accepted, fixed):
    """Return the last point of wall a and the first of wall b, on either side of the bearing of their intersection.

    A point changes sides only if it lies within ``accepted`` of the wall that takes it [m]. Where the break is the end
    of a closed scan (``fixed``) a wall may lose points there but not take any.
    """
    last = segment_a.last
    first = segment_b.first
    while (
        last > segment_a.begin
        and is_before(x, y, xs[last], ys[last])
        and (fixed or is_near(segment_b, xs[last], ys[last], accepted))
    ):
        last -= 1
    while (
        not fixed
        and last + 1 < segment_b.end
        and not is_before(x, y, xs[last + 1], ys[last + 1])
        and is_near(segment_a, xs[last + 1], ys[last + 1], accepted)
    ):
        last += 1
    while (
        first < segment_b.end
        and not is_before(x, y, xs[first], ys[first])
        and (fixed or is_near(segment_a, xs[first], ys[first], accepted))
    ):
        first += 1
    while (
        not fixed
        and first - 1 > segment_a.begin
        and is_before(x, y, xs[first - 1], ys[first - 1])
        and is_near(segment_b, xs[first - 1], ys[first - 1], accepted)
    ):
        first -= 1
    return last, first


@inner(inline="always")
def is_before(x, y, point_x, point_y):
    """Whether a position lies clockwise of a point that is less than half a turn away."""
    return point_x * y - point_y * x < 0.0


@inner(inline="always")
def is_near(segment, x, y, accepted):
    """Whether a point is at most ``accepted`` away from the rough line of a segment [m]."""
    return abs(segment.normal_x * x + segment.normal_y * y - segment.offset) <= accepted


@inner()
def are_near(xs, ys, begin, end, segment_a, segment_b, accepted):
    """Whether each of the points begin..end-1 is at most ``accepted`` away from one of two rough lines [m]."""
    for i in range(begin, end):
        if not (is_near(segment_a, xs[i], ys[i], accepted) or is_near(segment_b, xs[i], ys[i], accepted)):
            return False
    return True


@inner()
def step_back(xs, ys, index, limit, x, y, distance):
    """Step from a point towards ``limit`` until it is ``distance`` away from a position; return where that is."""
    step = 1 if limit > index else -1
    while index != limit and (xs[index] - x) ** 2 + (ys[index] - y) ** 2 < distance * distance:
        index += step
    return index


@inner()
def walls_meet(xs, ys, joint, after, x, y, corner_gap):
    """Whether both segments end within ``corner_gap`` and the spacing of their points of their intersection [m]."""
    spacing2_a = (xs[joint] - xs[joint - 1]) ** 2 + (ys[joint] - ys[joint - 1]) ** 2
    spacing2_b = (xs[after] - xs[after + 1]) ** 2 + (ys[after] - ys[after + 1]) ** 2
    gap2_a = (x - xs[joint]) ** 2 + (y - ys[joint]) ** 2
    gap2_b = (x - xs[after]) ** 2 + (y - ys[after]) ** 2
    return max(gap2_a, gap2_b) <= (corner_gap + math.sqrt(max(spacing2_a, spacing2_b))) ** 2
