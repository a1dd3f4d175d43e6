# pyright: standard
"""From one scan to its lines and corners."""

import math
import threading

import numpy as np
from numba import f8, from_dtype, i8
from numpy.typing import NDArray

from features.compiled import READ_ONLY, inner, kernel
from features.config import ExtractionConfig, Rules
from features.feature import CORNER_RECORD, LINE_RECORD, Corners, Features, Lines
from features.fitting.corner import intersect_kernel
from features.fitting.fit_kernels import POLAR, fit_kernel, project_ends
from features.scan import LaserScan
from features.se2 import Array
from features.segmentation.beams import gather_returns, to_cartesian
from features.segmentation.breaks import fit_rough, gap_of, meet_at, reaches, trim_ends
from features.segmentation.meeting import is_arc, normal_of, walls_end
from features.segmentation.segments import SEGMENT_RECORD, drop_stubs, find_jumps, find_segments, is_short
from features.segmentation.straightness import bend_of, split_crooked
from features.sensor import SensorModel
from features.signature import Kind

DEFAULT_CONFIG = ExtractionConfig()

TURN_OF_BEND = 12.0
"""Turn of a parabola from end to end, times its length, over how far its ends are off its line (eq. M102)."""

CONCAVE, CONVEX = int(Kind.CONCAVE), int(Kind.CONVEX)


class _WorkArrays(threading.local):
    """Work arrays of one thread, kept between calls, so that a scan allocates only its results."""

    beams = -1
    points: Array
    indices: NDArray[np.int64]
    segments: NDArray[np.void]
    pieces: NDArray[np.void]
    sums: Array

    def hold(self, beams: int) -> None:
        # A closed scan is processed from any of its points through a whole turn, and its first wall once more.
        size = 3 * beams + 3
        self.points = np.empty((4, size))
        self.indices = np.empty((3, size), np.int64)
        self.segments = np.empty(beams + 1, SEGMENT_RECORD)
        self.pieces = np.empty(beams + 1, SEGMENT_RECORD)
        self.sums = np.empty((9, beams + 1))
        self.beams = beams


_work = _WorkArrays()


def extract(scan: LaserScan, model: SensorModel, config: ExtractionConfig = DEFAULT_CONFIG) -> Features:
    """Extract the lines and corners of a scan.

    Points are clustered by jump distance and split by iterative end point fit (IEPF). The break between two segments is
    moved to where their walls meet; a segment that two lines explain better than one is split again. A line is fitted
    to each segment; lines of neighbouring segments are intersected where both walls reach the intersection and are no
    arc. What may be bent, or may end unseen, has the larger covariance.

    Parameters
    ----------
    scan : sensor frame; beams without a return are skipped.
    model : noise and limits of the sensor; its mounting is not applied.
    config : rules for segments, lines and corners, the line fit and the form of the covariances.

    Returns
    -------
    Features
        Lines and corners in the sensor frame, in counter-clockwise order.
    """
    ranges = scan.ranges
    if ranges.size > _work.beams:
        _work.hold(ranges.size)
    lines, corners = _extract_kernel(
        ranges,
        scan.angles,
        model.sigma_range,
        model.sigma_bearing,
        model.range_min,
        model.range_max,
        config.rules,
        _work.points,
        _work.indices,
        _work.segments,
        _work.pieces,
        _work.sums,
    )
    return Features(Lines(lines), Corners(corners))


@inner()
def settle_breaks(xs, ys, total, spacing, noise, rules, segments, count):
    """Leave out the ends of each segment, fit its rough line, and move the breaks to where the walls meet."""
    for k in range(count):
        trim_ends(xs, ys, segments[k], rules.trim_points, rules.trim_sigmas * math.sqrt(noise[0]))
        fit_rough(xs, ys, segments[k])
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        if segments[k].joined and after != k:
            meet_at(xs, ys, total, segments[k], segments[after], spacing, noise, after == 0, rules)


@inner(forceinline=True)
def fit_segment(xs, ys, segment, var_range, var_bearing, rules, line):
    """Fill the line of a segment; False where it is too small or its points do not define one."""
    xs = xs[segment.begin : segment.end + 1]
    ys = ys[segment.begin : segment.end + 1]
    if xs.size < rules.min_points or is_short(xs[-1] - xs[0], ys[-1] - ys[0], var_range, rules):
        return False
    if not fit_kernel(xs, ys, var_range, var_bearing, rules.method, line):
        return False
    project_ends(xs, ys, line)
    line.count = xs.size
    return True


@inner()
def find_corner(xs, ys, total, spacing, segment_a, segment_b, line_a, line_b, noise, rules, corner):
    """Fill the corner of two neighbours; False where there is none.

    Both walls must reach the intersection of their lines, no beam may pass the end of either, the opening angle must be
    within the rules, and neither wall may run into an arc.
    """
    if not intersect_kernel(line_a, line_b, corner.position, corner.cov):
        return False
    x, y = corner.position[0], corner.position[1]
    wall_a = normal_of(line_a)
    wall_b = normal_of(line_b)
    last = segment_a.last
    first = segment_b.first
    if rules.tested and not (
        reaches(xs[last], ys[last], x, y, wall_a[0], wall_a[1], spacing, noise, rules)
        and reaches(xs[first], ys[first], x, y, wall_b[0], wall_b[1], spacing, noise, rules)
    ):
        return False
    ax = line_a.ends[0, 0] - line_a.ends[1, 0]
    ay = line_a.ends[0, 1] - line_a.ends[1, 1]
    bx = line_b.ends[1, 0] - line_b.ends[0, 0]
    by = line_b.ends[1, 1] - line_b.ends[0, 1]
    length_a = math.sqrt(ax * ax + ay * ay)
    length_b = math.sqrt(bx * bx + by * by)
    cross = ax * by - ay * bx
    corner.opening_angle = abs(math.atan2(cross, ax * bx + ay * by))
    corner.orientation = math.atan2(ay * length_b + by * length_a, ax * length_b + bx * length_a)
    corner.kind = CONVEX if cross > 0.0 else CONCAVE
    if not rules.corner_angle_min <= corner.opening_angle <= rules.corner_angle_max:
        return False
    if not rules.tested:
        return True
    # A wall that may be bent turns by so much from end to end: where another one runs into it there is no edge.
    turn = math.pi - corner.opening_angle
    if turn * length_a <= TURN_OF_BEND * segment_a.bend or turn * length_b <= TURN_OF_BEND * segment_b.bend:
        return False
    doubt_end(xs[last], ys[last], wall_a, noise, rules, corner)
    doubt_end(xs[first], ys[first], wall_b, noise, rules, corner)
    end = end_of(xs, ys, total, segment_a, segment_b)
    return walls_end(xs, ys, segment_a.begin, end, x, y, wall_a, wall_b, noise, rules)


@inner()
def doubt_end(end_x, end_y, wall, noise, rules, corner):
    """Enlarge the covariance of a corner by the doubt that a wall, whose last point is given, reaches it (eq. M103)."""
    gap, variance, _ = gap_of(end_x, end_y, corner.position[0], corner.position[1], wall[0], wall[1], noise)
    unseen = max(0.0, gap - rules.end_sigmas * math.sqrt(variance))
    doubt = rules.unseen_end * unseen * unseen / 3.0
    corner.cov[0, 0] += doubt * wall[1] * wall[1]
    corner.cov[0, 1] -= doubt * wall[0] * wall[1]
    corner.cov[1, 0] -= doubt * wall[0] * wall[1]
    corner.cov[1, 1] += doubt * wall[0] * wall[0]


@inner()
def end_of(xs, ys, total, segment_a, segment_b):
    """Return the last point of the second of two neighbours, its points being behind those of the first.

    In a closed scan of ``total`` points the first segment follows the last one; its points are copied behind them.
    """
    if segment_b.begin > segment_a.end:
        return segment_b.end
    for i in range(1, segment_b.end + 1):
        xs[total - 1 + i] = xs[i]
        ys[total - 1 + i] = ys[i]
    return total - 1 + segment_b.end


@inner(inline="always")
def bend_line(line, bend):
    """Enlarge the variance of the offset of a line by how far its ends may bend away from it (eq. M102)."""
    # The second parameter of a regression is not measured across the line.
    per_across2 = 1.0 if line.form == POLAR else 1.0 + line.params[0] * line.params[0]
    line.cov[1, 1] += bend * bend * per_across2


@inner()
def part_arc(xs, ys, total, segment_a, segment_b, line_a, line_b, noise, rules, corner):
    """Part two neighbours that may be an arc, and enlarge the ``bend`` of both (eq. M102)."""
    ax = line_a.ends[1, 0] - line_a.ends[0, 0]
    ay = line_a.ends[1, 1] - line_a.ends[0, 1]
    bx = line_b.ends[1, 0] - line_b.ends[0, 0]
    by = line_b.ends[1, 1] - line_b.ends[0, 1]
    turn = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
    if not intersect_kernel(line_a, line_b, corner.position, corner.cov):
        return
    end = end_of(xs, ys, total, segment_a, segment_b)
    x, y = corner.position[0], corner.position[1]
    if is_arc(xs, ys, segment_a.begin, end, x, y, normal_of(line_a), normal_of(line_b), noise, rules):
        length2_a = ax * ax + ay * ay
        length2_b = bx * bx + by * by
        per_length2 = 2.0 * turn / (TURN_OF_BEND * (math.sqrt(length2_a) + math.sqrt(length2_b)))
        segment_a.bend = max(segment_a.bend, per_length2 * length2_a)
        segment_b.bend = max(segment_b.bend, per_length2 * length2_b)
        segment_a.joined = 0


@kernel(
    READ_ONLY, READ_ONLY, f8, f8, f8, f8, f8[::1], f8[:, ::1], i8[:, ::1], from_dtype(SEGMENT_RECORD)[::1],
    from_dtype(SEGMENT_RECORD)[::1], f8[:, ::1], nogil=True,
)  # fmt: skip
def _extract_kernel(
    scan_ranges, scan_angles, sigma_range, sigma_bearing, range_min, range_max, numbers, points, indices, segments,
    pieces, sums,
):  # fmt: skip
    rules = Rules(
        numbers[0], numbers[1], numbers[2], numbers[3], int(numbers[4]), numbers[5], int(numbers[6]), numbers[7],
        numbers[8], numbers[9], numbers[10], numbers[11], numbers[12], numbers[13], numbers[14], numbers[15],
        numbers[16], int(numbers[17]), int(numbers[18]),
    )  # fmt: skip
    if scan_angles.size < rules.min_points:
        return np.empty(0, LINE_RECORD), np.empty(0, CORNER_RECORD)
    var_range = sigma_range * sigma_range
    var_bearing = sigma_bearing * sigma_bearing
    noise = (var_range, var_bearing)
    xs, ys, ranges, angles = points[0], points[1], points[2], points[3]
    beams, jumps, stack = indices[0], indices[1], indices[2]

    n, spacing = gather_returns(scan_ranges, scan_angles, range_min, range_max, ranges, angles, beams)
    if n < rules.min_points:
        return np.empty(0, LINE_RECORD), np.empty(0, CORNER_RECORD)
    to_cartesian(ranges, angles, n, xs, ys)
    slack = rules.split_sigmas * sigma_range
    closed = find_jumps(xs, ys, ranges, angles, n, slack, rules.jump_angle, rules.gap_beams * spacing, jumps)

    # Points begin behind a jump. A closed contour has none: it begins and ends at its farthest point, a vertex.
    start = ranges[:n].argmax() if closed else (jumps[:n].argmax() + 1) * (jumps[n - 1] == 0)
    total = n + 1 if closed else n
    for i in range(start + 1):
        xs[n + i] = xs[i]
        ys[n + i] = ys[i]
        beams[n + i] = beams[i]
        jumps[n + i] = jumps[i]
    xs, ys, beams, jumps = xs[start:], ys[start:], beams[start:], jumps[start:]
    if closed:
        jumps[n] = 1

    count = find_segments(xs, ys, jumps, total, var_range, var_bearing, rules, stack, segments)
    if closed and count > 0:
        segments[count - 1].joined = 1
    if rules.tested:
        settle_breaks(xs, ys, total, spacing, noise, rules, segments, count)
        count = split_crooked(xs, ys, segments, count, noise, rules, sums, stack, pieces)
        count = drop_stubs(xs, ys, var_range, rules, pieces, count)
        settle_breaks(xs, ys, total, spacing, noise, rules, pieces, count)
        segments = pieces
    else:
        for k in range(count):
            trim_ends(xs, ys, segments[k], rules.trim_points, rules.trim_sigmas * sigma_range)

    lines = np.empty(count, LINE_RECORD)
    found = 0
    for k in range(count):
        if fit_segment(xs, ys, segments[k], var_range, var_bearing, rules, lines[found]):
            lines[found].beams[0] = beams[segments[k].begin]
            lines[found].beams[1] = beams[segments[k].end]
            segments[k].line = found
            segments[k].bend = bend_of(xs, ys, segments[k], noise, rules) if rules.tested else 0.0
            found += 1
        else:
            segments[k].line = -1
    corners = np.empty(found, CORNER_RECORD)
    for k in range(count if rules.tested else 0):
        after = k + 1 if k + 1 < count else 0
        a = segments[k].line
        b = segments[after].line
        if segments[k].joined and after != k and a >= 0 and b >= 0:
            part_arc(xs, ys, total, segments[k], segments[after], lines[a], lines[b], noise, rules, corners[0])
    for k in range(count):
        if segments[k].line >= 0:
            bend_line(lines[segments[k].line], segments[k].bend)
    met = 0
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        a = segments[k].line
        b = segments[after].line
        if segments[k].joined and after != k and a >= 0 and b >= 0:
            met += find_corner(
                xs, ys, total, spacing, segments[k], segments[after], lines[a], lines[b], noise, rules, corners[met]
            )
    return lines[:found], corners[:met]
