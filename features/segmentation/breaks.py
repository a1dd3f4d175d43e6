# pyright: standard
"""The breaks between segments: which points belong to which of two walls, or to neither."""

import math

from features.compiled import inner
from features.fitting.fit_kernels import moments

GRAZING = 1e-12
"""Least squared cosine of an incidence, so that a beam along a wall hits it somewhere."""


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
def meet_at(xs, ys, total, segment_a, segment_b, spacing, noise, closing, rules):
    """Move the break between two neighbours to where their walls meet (eq. M25).

    They stay joined if both reach that point and all points between them are of one or the other: what was too short
    for a line may be noise at a corner, or a wall that stands between. ``noise`` is the variance of a range and of a
    bearing; ``closing`` says that the break is the end of a closed scan, whose points are ``total``.
    """
    determinant = segment_a.normal_x * segment_b.normal_y - segment_a.normal_y * segment_b.normal_x
    if determinant == 0.0:
        return
    x = (segment_a.offset * segment_b.normal_y - segment_b.offset * segment_a.normal_y) / determinant
    y = (segment_b.offset * segment_a.normal_x - segment_a.offset * segment_b.normal_x) / determinant
    last, first = move_break(xs, ys, x, y, segment_a, segment_b, noise, closing, rules)
    segment_a.joined = (
        reaches(xs[last], ys[last], x, y, segment_a.normal_x, segment_a.normal_y, spacing, noise, rules)
        and reaches(xs[first], ys[first], x, y, segment_b.normal_x, segment_b.normal_y, spacing, noise, rules)
        and are_near(xs, ys, last + 1, total if closing else first, segment_a, segment_b, noise, rules)
        and are_near(xs, ys, 0, first if closing else 0, segment_a, segment_b, noise, rules)
    )
    if segment_a.joined:
        segment_a.last = last
        segment_b.first = first
        trim = rules.trim_sigmas * math.sqrt(noise[0])
        segment_a.end = step_back(xs, ys, last - rules.trim_points, segment_a.begin, x, y, trim)
        segment_b.begin = step_back(xs, ys, first + rules.trim_points, segment_b.end, x, y, trim)


@inner()
def move_break(xs, ys, x, y, segment_a, segment_b, noise, fixed, rules):
    """Return the last point of wall a and the first of wall b, on either side of the bearing of their intersection.

    A point changes sides only if it is near the wall that takes it. Where the break is the end
    of a closed scan (``fixed``) a wall may lose points there but not take any.
    """
    last = segment_a.last
    first = segment_b.first
    while (
        last > segment_a.begin
        and is_before(x, y, xs[last], ys[last])
        and (fixed or is_near(segment_b, xs[last], ys[last], noise, rules))
    ):
        last -= 1
    while (
        not fixed
        and last + 1 < segment_b.end
        and not is_before(x, y, xs[last + 1], ys[last + 1])
        and is_near(segment_a, xs[last + 1], ys[last + 1], noise, rules)
    ):
        last += 1
    while (
        first < segment_b.end
        and not is_before(x, y, xs[first], ys[first])
        and (fixed or is_near(segment_a, xs[first], ys[first], noise, rules))
    ):
        first += 1
    while (
        not fixed
        and first - 1 > segment_a.begin
        and is_before(x, y, xs[first - 1], ys[first - 1])
        and is_near(segment_b, xs[first - 1], ys[first - 1], noise, rules)
    ):
        first -= 1
    return last, first


@inner(inline="always")
def is_before(x, y, point_x, point_y):
    """Whether a position lies clockwise of a point that is less than half a turn away."""
    return point_x * y - point_y * x < 0.0


@inner(inline="always")
def misfit(x, y, wall, noise):
    """Squared distance of a point from a wall, normal_x, normal_y, offset, over its variance (eq. M3)."""
    across = wall[0] * x + wall[1] * y
    rho2 = x * x + y * y
    residual = across - wall[2]
    return residual * residual / (noise[0] * across * across / rho2 + noise[1] * (rho2 - across * across))


@inner(inline="always")
def is_near(segment, x, y, noise, rules):
    """Whether a point lies on the rough line of a segment, by all that noise allows."""
    wall = (segment.normal_x, segment.normal_y, segment.offset)
    return misfit(x, y, wall, noise) <= rules.near_sigmas * rules.near_sigmas


@inner()
def are_near(xs, ys, begin, end, segment_a, segment_b, noise, rules):
    """Whether each of the points begin..end-1 lies on one of two rough lines."""
    for i in range(begin, end):
        if not (is_near(segment_a, xs[i], ys[i], noise, rules) or is_near(segment_b, xs[i], ys[i], noise, rules)):
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
def reaches(end_x, end_y, x, y, normal_x, normal_y, spacing, noise, rules):
    """Whether a wall whose last point is given reaches a place: the next beam would hit it beyond that (eq. M103)."""
    rho2 = x * x + y * y
    gap, variance, facing = gap_of(end_x, end_y, x, y, normal_x, normal_y, noise)
    return gap <= spacing * math.sqrt(rho2 / max(facing, GRAZING)) + rules.end_sigmas * math.sqrt(variance)


@inner(inline="always")
def gap_of(end_x, end_y, x, y, normal_x, normal_y, noise):
    """Return how far the last point of a wall lies from a place along the wall, and the noise of that.

    Returns
    -------
    gap : distance along the wall [m].
    variance : of a point at that place, along the wall [m^2].
    facing : squared cosine of the incidence of a beam at that place.
    """
    rho2 = x * x + y * y
    across = normal_x * x + normal_y * y
    facing = across * across / rho2
    gap = abs(normal_x * (end_y - y) - normal_y * (end_x - x))
    return gap, noise[0] * (1.0 - facing) + noise[1] * rho2 * facing, facing
