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
from features.fitting.fit_kernels import fit_kernel, project_ends
from features.scan import LaserScan
from features.se2 import Array
from features.segmentation.beams import gather_returns, to_cartesian
from features.segmentation.breaks import fit_rough, meet_at, trim_ends, walls_meet
from features.segmentation.segments import SEGMENT_RECORD, find_jumps, find_segments, is_short
from features.sensor import SensorModel
from features.signature import Kind

DEFAULT_CONFIG = ExtractionConfig()

CONCAVE, CONVEX = int(Kind.CONCAVE), int(Kind.CONVEX)


class _WorkArrays(threading.local):
    """Work arrays of one thread, kept between calls, so that a scan allocates only its results."""

    beams = -1
    points: Array
    indices: NDArray[np.int64]
    segments: NDArray[np.void]

    def hold(self, beams: int) -> None:
        # A closed scan is processed from any of its points through a whole turn.
        size = 2 * beams + 2
        self.points = np.empty((4, size))
        self.indices = np.empty((3, size), np.int64)
        self.segments = np.empty(beams + 1, SEGMENT_RECORD)
        self.beams = beams


_work = _WorkArrays()


def extract(scan: LaserScan, model: SensorModel, config: ExtractionConfig = DEFAULT_CONFIG) -> Features:
    """Extract the lines and corners of a scan.

    Points are clustered by jump distance and split by iterative end point fit (IEPF). The break between two segments is
    moved to where their walls meet. A line is fitted to each segment; lines of neighbouring segments are intersected.

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
    )
    return Features(Lines(lines), Corners(corners))


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
def find_corner(xs, ys, segment_a, segment_b, line_a, line_b, rules, corner):
    """Fill the corner of two neighbours; False where the walls do not meet or their angle is outside the rules."""
    if not intersect_kernel(line_a, line_b, corner.position, corner.cov):
        return False
    if not walls_meet(
        xs, ys, segment_a.last, segment_b.first, corner.position[0], corner.position[1], rules.corner_gap
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
    return rules.corner_angle_min <= corner.opening_angle <= rules.corner_angle_max


@kernel(
    READ_ONLY, READ_ONLY, f8, f8, f8, f8, f8[::1], f8[:, ::1], i8[:, ::1], from_dtype(SEGMENT_RECORD)[::1], nogil=True
)  # fmt: skip
def _extract_kernel(
    scan_ranges, scan_angles, sigma_range, sigma_bearing, range_min, range_max, numbers, points, indices, segments
):
    rules = Rules(
        numbers[0], numbers[1], numbers[2], numbers[3], int(numbers[4]), numbers[5], int(numbers[6]), numbers[7],
        numbers[8], numbers[9], numbers[10], numbers[11], int(numbers[12]),
    )  # fmt: skip
    if scan_angles.size < rules.min_points:
        return np.empty(0, LINE_RECORD), np.empty(0, CORNER_RECORD)
    var_range = sigma_range * sigma_range
    var_bearing = sigma_bearing * sigma_bearing
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
    for k in range(count):
        trim_ends(xs, ys, segments[k], rules.trim_points, rules.trim_sigmas * sigma_range)
        fit_rough(xs, ys, segments[k])
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        if segments[k].joined and after != k:
            meet_at(xs, ys, total, segments[k], segments[after], sigma_range, after == 0, rules)

    lines = np.empty(count, LINE_RECORD)
    found = 0
    for k in range(count):
        if fit_segment(xs, ys, segments[k], var_range, var_bearing, rules, lines[found]):
            lines[found].beams[0] = beams[segments[k].begin]
            lines[found].beams[1] = beams[segments[k].end]
            segments[k].line = found
            found += 1
        else:
            segments[k].line = -1
    corners = np.empty(found, CORNER_RECORD)
    met = 0
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        a = segments[k].line
        b = segments[after].line
        if segments[k].joined and after != k and a >= 0 and b >= 0:
            met += find_corner(xs, ys, segments[k], segments[after], lines[a], lines[b], rules, corners[met])
    return lines[:found], corners[:met]
