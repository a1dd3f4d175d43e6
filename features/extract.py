"""From one scan to its lines and corners."""

import math

import numpy as np
from numba import njit

from features.config import ExtractionConfig, Rules
from features.corner import intersect_kernel
from features.feature import Corners, Features, Lines
from features.line_fit import (
    COV_SLOPE_INTERCEPT,
    FORM,
    LINE_FIELDS,
    SLOPE,
    VAR_INTERCEPT,
    VAR_SLOPE,
    fit_kernel,
    fit_rough,
    method_number,
    project_ends,
)
from features.scan import LaserScan
from features.segmentation import (
    drop_stubs,
    find_jumps,
    mean_spacing,
    merge_segments,
    move_break,
    order_beams,
    rotate,
    split_segments,
    step_back,
    trim_ends,
)
from features.sensor import SensorModel

DEFAULT_CONFIG = ExtractionConfig()


def extract(scan: LaserScan, model: SensorModel, config: ExtractionConfig = DEFAULT_CONFIG) -> Features:
    """Extract the lines and corners of a scan.

    Clusters by jump distance, splits by IEPF, moves each break to where its two walls meet, fits each segment and
    intersects neighbours.

    Parameters
    ----------
    scan : sensor frame; beams without a return are skipped.
    model : noise and limits of the sensor; its mounting is not applied.
    config : rules for segments, lines and corners, the line fit and the form of the covariances.

    Returns
    -------
    Features
        Lines and corners in the sensor frame, counter-clockwise; both empty where the scan shows none.
    """
    forms, params, line_covs, ends, beams, counts, positions, covs, shapes, convex = _extract_kernel(
        scan.ranges,
        scan.angles,
        model.sigma_range,
        model.sigma_bearing,
        model.range_min,
        model.range_max,
        method_number(config.fit, config.covariance),
        config.rules,
    )
    return Features(
        Lines(forms, params[:, :2], params[:, 2], line_covs, ends, beams, counts),
        Corners(positions, covs, shapes[:, 0], shapes[:, 1], convex),
    )


@njit(cache=True, error_model="numpy")
def _extract_kernel(scan_ranges, scan_angles, sigma_range, sigma_bearing, range_min, range_max, method, numbers):
    rules = Rules(
        numbers[0], numbers[1], numbers[2], numbers[3], int(numbers[4]), numbers[5], int(numbers[6]), numbers[7],
        numbers[8], numbers[9], numbers[10],
    )  # fmt: skip
    var_range = sigma_range * sigma_range
    var_bearing = sigma_bearing * sigma_bearing
    if scan_angles.size < rules.min_points:
        return _results(0, 0)
    order, turned = order_beams(scan_angles)
    largest_gap = rules.gap_beams * mean_spacing(turned)

    size = scan_angles.size
    beams = np.empty(size + 1, np.int64)
    ranges = np.empty(size + 1)
    angles = np.empty(size + 1)
    n = 0
    for i in range(size):
        beam = order[i]
        if scan_ranges[beam] > 0.0 and range_min <= scan_ranges[beam] <= range_max:
            beams[n] = beam
            ranges[n] = scan_ranges[beam]
            angles[n] = turned[i]
            n += 1
    if n < rules.min_points:
        return _results(0, 0)
    xs = np.empty(size + 1)
    ys = np.empty(size + 1)
    for i in range(n):
        xs[i] = ranges[i] * math.cos(angles[i])
        ys[i] = ranges[i] * math.sin(angles[i])

    jumps = np.empty(size + 1, np.bool_)
    slack = rules.split_sigmas * sigma_range
    closed = find_jumps(xs, ys, ranges, angles, n, slack, rules.jump_angle, largest_gap, jumps)
    # A closed contour has no jump; its farthest point is a vertex: it starts and ends there.
    total = n
    if closed:
        start = ranges[:n].argmax()
        total = n + 1
    else:
        start = (n if jumps[n - 1] else jumps[:n].argmax() + 1) % n
    if start > 0:
        rotate(beams[:n], start)
        rotate(angles[:n], start)
        rotate(jumps[:n], start)
        rotate(xs[:n], start)
        rotate(ys[:n], start)
    if closed:
        beams[n] = beams[0]
        angles[n] = angles[0]
        xs[n] = xs[0]
        ys[n] = ys[0]
        jumps[n] = True

    stack = np.empty((total + 1, 2), np.int64)
    firsts = np.empty(total + 1, np.int64)
    lasts = np.empty(total + 1, np.int64)
    segments = 0
    begin = 0
    for i in range(total):
        if not jumps[i]:
            continue
        # A segment of fewer points is no line, and its neighbours have no corner with it.
        if i - begin + 1 >= rules.min_points:
            added = split_segments(
                xs,
                ys,
                begin,
                i,
                var_range,
                var_bearing,
                rules.split_distance,
                rules.split_sigmas,
                stack,
                firsts[segments:],
            )
            segments += merge_segments(
                xs,
                ys,
                i,
                var_range,
                var_bearing,
                rules.split_distance,
                rules.split_sigmas,
                firsts[segments:],
                lasts[segments:],
                added,
            )
        begin = i + 1

    segments, joined = drop_stubs(
        xs, ys, firsts, lasts, segments, rules.min_points + 2 * rules.trim_points, rules.min_length
    )
    if closed and segments > 0:
        joined[segments - 1] = True
    spans = np.empty((segments, 2), np.int64)
    rough = np.empty((segments, LINE_FIELDS))
    usable = np.empty(segments, np.bool_)
    for k in range(segments):
        first, last = trim_ends(xs, ys, firsts[k], lasts[k], rules.trim_points, rules.trim_sigmas * sigma_range)
        spans[k, 0] = first
        spans[k, 1] = last
        usable[k] = last > first
        if usable[k]:
            fit_rough(xs, ys, first, last, rough[k])
    position = np.empty(2)
    cov = np.empty((2, 2))
    accepted = max(rules.split_distance, rules.split_sigmas * sigma_range)
    for a in range(segments):
        b = a + 1 if a + 1 < segments else 0
        if a == b or not joined[a] or not (usable[a] and usable[b]):
            continue
        if not intersect_kernel(rough[a], rough[b], position, cov):
            continue
        last, first = move_break(
            xs,
            ys,
            angles,
            position,
            rough[a],
            rough[b],
            (spans[a, 0], lasts[a]),
            (firsts[b], spans[b, 1]),
            accepted,
            b == 0,
        )
        if _walls_meet(xs, ys, last, first, position, rules.corner_gap):
            lasts[a] = last
            firsts[b] = first
            spans[a, 1] = step_back(
                xs, ys, last - rules.trim_points, spans[a, 0], position, rules.trim_sigmas * sigma_range
            )
            spans[b, 0] = step_back(
                xs, ys, first + rules.trim_points, spans[b, 1], position, rules.trim_sigmas * sigma_range
            )
        else:
            joined[a] = False

    rows = np.empty((segments, LINE_FIELDS))
    ends = np.empty((segments, 2, 2))
    numbers_of = np.empty(segments, np.int64)
    lines = 0
    for k in range(segments):
        first = spans[k, 0]
        last = spans[k, 1]
        if last - first + 1 < rules.min_points:
            continue
        if math.hypot(xs[last] - xs[first], ys[last] - ys[first]) < rules.min_length:
            continue
        if not fit_kernel(xs, ys, first, last, var_range, var_bearing, method, rows[lines]):
            continue
        project_ends(xs, ys, first, last, rows[lines], ends[lines])
        spans[lines, 0] = first
        spans[lines, 1] = last
        firsts[lines] = firsts[k]
        lasts[lines] = lasts[k]
        numbers_of[lines] = k
        lines += 1

    results = _results(lines, lines)
    forms, params, line_covs, line_ends, line_beams, counts, positions, covs, shapes, convex = results
    for k in range(lines):
        forms[k] = np.int64(rows[k, FORM])
        params[k] = rows[k, SLOPE : SLOPE + 3]
        line_covs[k, 0, 0] = rows[k, VAR_SLOPE]
        line_covs[k, 1, 1] = rows[k, VAR_INTERCEPT]
        line_covs[k, 0, 1] = line_covs[k, 1, 0] = rows[k, COV_SLOPE_INTERCEPT]
        line_ends[k] = ends[k]
        line_beams[k, 0] = beams[spans[k, 0]]
        line_beams[k, 1] = beams[spans[k, 1]]
        counts[k] = spans[k, 1] - spans[k, 0] + 1
    corners = 0
    for a in range(lines):
        b = a + 1 if a + 1 < lines else 0
        k = numbers_of[a]
        if a == b or not joined[k] or numbers_of[b] != (k + 1) % segments:
            continue
        if not intersect_kernel(rows[a], rows[b], positions[corners], covs[corners]):
            continue
        if not _walls_meet(xs, ys, lasts[a], firsts[b], positions[corners], rules.corner_gap):
            continue
        convex[corners] = _corner_shape(ends[a], ends[b], shapes[corners])
        if rules.corner_angle_min <= shapes[corners, 0] <= rules.corner_angle_max:
            corners += 1
    return (
        forms, params, line_covs, line_ends, line_beams, counts,
        positions[:corners], covs[:corners], shapes[:corners], convex[:corners],
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _results(lines, corners):
    return (
        np.empty(lines, np.int64),
        np.empty((lines, 3)),
        np.empty((lines, 2, 2)),
        np.empty((lines, 2, 2)),
        np.empty((lines, 2), np.int64),
        np.empty(lines, np.int64),
        np.empty((corners, 2)),
        np.empty((corners, 2, 2)),
        np.empty((corners, 2)),
        np.empty(corners, np.bool_),
    )


@njit(cache=True, error_model="numpy")
def _walls_meet(xs, ys, joint, after, position, corner_gap):
    """Whether both segments end at their intersection, as near as the spacing of their points tells."""
    spacing_a = math.hypot(xs[joint] - xs[joint - 1], ys[joint] - ys[joint - 1])
    spacing_b = math.hypot(xs[after] - xs[after + 1], ys[after] - ys[after + 1])
    allowed = corner_gap + max(spacing_a, spacing_b)
    gap_a = math.hypot(position[0] - xs[joint], position[1] - ys[joint])
    gap_b = math.hypot(position[0] - xs[after], position[1] - ys[after])
    return max(gap_a, gap_b) <= allowed


@njit(cache=True, error_model="numpy")
def _corner_shape(ends_a, ends_b, shape):
    """Fill opening angle and orientation of the corner from line a to line b, counter-clockwise; True if convex."""
    ax = ends_a[0, 0] - ends_a[1, 0]
    ay = ends_a[0, 1] - ends_a[1, 1]
    bx = ends_b[1, 0] - ends_b[0, 0]
    by = ends_b[1, 1] - ends_b[0, 1]
    length_a = math.hypot(ax, ay)
    length_b = math.hypot(bx, by)
    cross = (ax * by - ay * bx) / (length_a * length_b)
    dot = (ax * bx + ay * by) / (length_a * length_b)
    shape[0] = abs(math.atan2(cross, dot))
    shape[1] = math.atan2(ay / length_a + by / length_b, ax / length_a + bx / length_b)
    return cross > 0.0
