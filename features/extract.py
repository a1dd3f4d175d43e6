"""From one scan to its lines and corners."""

import math

import numpy as np
from numba import njit

from features.config import ExtractionConfig
from features.corner import intersect_kernel
from features.feature import Corners, Features, Lines
from features.line_fit import (
    CENTER,
    COV_SLOPE_INTERCEPT,
    INTERCEPT,
    LINE_FIELDS,
    SLOPE,
    VAR_INTERCEPT,
    VAR_SLOPE,
    VERTICAL,
    fit_cwlf_kernel,
    project_ends,
)
from features.scan import LaserScan
from features.segmentation import find_jumps, mean_spacing, merge_segments, order_beams, split_segments, trim_ends
from features.sensor import SensorModel

DEFAULT_CONFIG = ExtractionConfig()


def extract(scan: LaserScan, model: SensorModel, config: ExtractionConfig = DEFAULT_CONFIG) -> Features:
    """Extract the lines and corners of a scan.

    Clusters by jump distance, splits by IEPF, fits each segment by CWLF and intersects neighbours.

    Parameters
    ----------
    scan : sensor frame; beams without a return are skipped.
    model : noise and limits of the sensor; its mounting is not applied.
    config : rules for segments, lines and corners, and the form of the covariances.

    Returns
    -------
    Features
        Lines and corners in the sensor frame, counter-clockwise; both empty where the scan shows none.
    """
    rows, ends, beams, counts, positions, covs, shapes = _extract_kernel(
        scan.ranges,
        scan.angles,
        model.sigma_range,
        model.sigma_bearing,
        model.range_min,
        model.range_max,
        config.covariance == "propagated",
        math.radians(config.jump_angle_deg),
        config.gap_beams,
        config.split_distance_mm * 1e-3,
        config.split_sigmas,
        config.trim_points,
        config.trim_sigmas,
        config.min_points,
        config.min_length_m,
        math.radians(config.corner_angle_min_deg),
        math.radians(config.corner_angle_max_deg),
        config.corner_gap_mm * 1e-3,
    )
    line_covs = np.empty((len(rows), 2, 2))
    line_covs[:, 0, 0] = rows[:, VAR_SLOPE]
    line_covs[:, 1, 1] = rows[:, VAR_INTERCEPT]
    line_covs[:, 0, 1] = line_covs[:, 1, 0] = rows[:, COV_SLOPE_INTERCEPT]
    return Features(
        lines=Lines(
            vertical=rows[:, VERTICAL] > 0.5,
            params=rows[:, [SLOPE, INTERCEPT, CENTER]],
            covs=line_covs,
            ends=ends,
            beams=beams,
            counts=counts,
        ),
        corners=Corners(
            positions=positions,
            covs=covs,
            opening_angles=shapes[:, 0],
            orientations=shapes[:, 1],
            convex=shapes[:, 2] > 0.5,
        ),
    )


@njit(cache=True)
def _extract_kernel(
    scan_ranges,
    scan_angles,
    sigma_range,
    sigma_bearing,
    range_min,
    range_max,
    propagated,
    jump_angle,
    gap_beams,
    split_distance,
    split_sigmas,
    trim,
    trim_sigmas,
    min_points,
    min_length,
    corner_angle_min,
    corner_angle_max,
    corner_gap,
):
    var_range = sigma_range * sigma_range
    var_bearing = sigma_bearing * sigma_bearing
    if scan_angles.size < min_points:
        return _no_features()
    beams, angles = order_beams(scan_angles)
    spacing = mean_spacing(angles)
    ranges = scan_ranges[beams]
    returned = (ranges > 0.0) & (ranges >= range_min) & (ranges <= range_max)
    beams, angles, ranges = beams[returned], angles[returned], ranges[returned]
    n = beams.size
    if n < min_points:
        return _no_features()
    jumps = find_jumps(ranges, angles, sigma_range, split_sigmas, jump_angle, gap_beams * spacing)

    # Start behind a jump; a closed contour has none, and its farthest point is a vertex: it starts and ends there.
    closed = not jumps.any()
    start = ranges.argmax() if closed else (jumps.argmax() + 1) % n
    total = n + 1 if closed else n
    order = (np.arange(total) + start) % n
    ranges = ranges[order]
    angles = angles[order]
    beams = beams[order]
    jumps = jumps[order]
    if closed:
        jumps[-1] = True
    xs = ranges * np.cos(angles)
    ys = ranges * np.sin(angles)

    stack = np.empty((total + 1, 2), np.int64)
    firsts = np.empty(total + 1, np.int64)
    lasts = np.empty(total + 1, np.int64)
    segments = 0
    cluster_start = 0
    for i in range(total):
        if not jumps[i]:
            continue
        if i > cluster_start:
            added = split_segments(
                xs, ys, cluster_start, i, var_range, var_bearing, split_distance, split_sigmas, stack, firsts[segments:]
            )
            segments += merge_segments(
                xs,
                ys,
                i,
                var_range,
                var_bearing,
                split_distance,
                split_sigmas,
                firsts[segments:],
                lasts[segments:],
                added,
            )
        cluster_start = i + 1

    rows = np.empty((segments, LINE_FIELDS))
    ends = np.empty((segments, 2, 2))
    spans = np.empty((segments, 2), np.int64)
    breaks = np.empty((segments, 2), np.int64)
    lines = 0
    for k in range(segments):
        first, last = trim_ends(xs, ys, firsts[k], lasts[k], trim, trim_sigmas * sigma_range)
        if last - first + 1 < min_points:
            continue
        if math.hypot(xs[last] - xs[first], ys[last] - ys[first]) < min_length:
            continue
        if not fit_cwlf_kernel(xs, ys, first, last, var_range, var_bearing, propagated, rows[lines]):
            continue
        project_ends(xs, ys, first, last, rows[lines], ends[lines])
        spans[lines, 0] = first
        spans[lines, 1] = last
        breaks[lines, 0] = firsts[k]
        breaks[lines, 1] = lasts[k]
        lines += 1

    positions = np.empty((lines, 2))
    covs = np.empty((lines, 2, 2))
    shapes = np.empty((lines, 3))
    corners = 0
    for a in range(lines):
        b = (a + 1) % lines
        joint = breaks[a, 1]
        wraps = closed and joint == total - 1 and breaks[b, 0] == 0
        if a == b or not (joint == breaks[b, 0] or wraps):
            continue
        if not intersect_kernel(rows[a], rows[b], positions[corners], covs[corners]):
            continue
        after = 0 if wraps else joint
        spacing_a = math.hypot(xs[joint] - xs[joint - 1], ys[joint] - ys[joint - 1])
        spacing_b = math.hypot(xs[after] - xs[after + 1], ys[after] - ys[after + 1])
        gap = math.hypot(positions[corners, 0] - xs[joint], positions[corners, 1] - ys[joint])
        if gap > corner_gap + max(spacing_a, spacing_b):
            continue
        if not _corner_shape(ends[a], ends[b], shapes[corners]):
            continue
        if not corner_angle_min <= shapes[corners, 0] <= corner_angle_max:
            continue
        corners += 1

    line_beams = np.empty((lines, 2), np.int64)
    counts = np.empty(lines, np.int64)
    for k in range(lines):
        line_beams[k, 0] = beams[spans[k, 0]]
        line_beams[k, 1] = beams[spans[k, 1]]
        counts[k] = spans[k, 1] - spans[k, 0] + 1
    return (
        rows[:lines].copy(),
        ends[:lines].copy(),
        line_beams,
        counts,
        positions[:corners].copy(),
        covs[:corners].copy(),
        shapes[:corners].copy(),
    )


@njit(cache=True)
def _corner_shape(ends_a, ends_b, shape):
    """Fill opening angle, orientation and convexity (0 or 1) of the corner from line a to line b, counter-clockwise."""
    ax = ends_a[0, 0] - ends_a[1, 0]
    ay = ends_a[0, 1] - ends_a[1, 1]
    bx = ends_b[1, 0] - ends_b[0, 0]
    by = ends_b[1, 1] - ends_b[0, 1]
    length_a = math.hypot(ax, ay)
    length_b = math.hypot(bx, by)
    if length_a == 0.0 or length_b == 0.0:
        return False
    cross = (ax * by - ay * bx) / (length_a * length_b)
    dot = (ax * bx + ay * by) / (length_a * length_b)
    shape[0] = abs(math.atan2(cross, dot))
    shape[1] = math.atan2(ay / length_a + by / length_b, ax / length_a + bx / length_b)
    shape[2] = 1.0 if cross > 0.0 else 0.0
    return True


@njit(cache=True)
def _no_features():
    return (
        np.empty((0, LINE_FIELDS)),
        np.empty((0, 2, 2)),
        np.empty((0, 2), np.int64),
        np.empty(0, np.int64),
        np.empty((0, 2)),
        np.empty((0, 2, 2)),
        np.empty((0, 3)),
    )
