"""Plain twin of the compiled extraction: the same rules, written again from their definitions and with matrices.

Shares no code with ``features`` and imports nothing of it.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TwinLine:
    """A line as its regression (slope, intercept at center) and as indices of the beams it was fitted to."""

    vertical: bool
    slope: float
    intercept: float
    center: float
    cov: np.ndarray
    ends: np.ndarray
    beams: tuple[int, int]
    count: int


@dataclass(frozen=True)
class TwinCorner:
    """A corner."""

    position: np.ndarray
    cov: np.ndarray
    opening_angle: float
    orientation: float
    convex: bool


def cartesian_cov(rho, theta, sigma_range, sigma_bearing):
    """Eq. 9-10 as the product A C A'."""
    c, s = np.cos(theta), np.sin(theta)
    axes = np.array([[c, -s], [s, c]])
    return axes @ np.diag([sigma_range**2, (rho * sigma_bearing) ** 2]) @ axes.T


def fit_line(ranges, angles, sigma_range, sigma_bearing, form):
    """Eq. 20-35 in the form of eq. 25-26: slope and intercept of the plain axes, then shifted to the centroid."""
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    covs = np.array([cartesian_cov(r, a, sigma_range, sigma_bearing) for r, a in zip(ranges, angles, strict=True)])
    n1, n2 = len(points) * ((points - points.mean(axis=0)) ** 2).sum(axis=0)
    vertical = bool(n2 > n1)
    iu, iv = (1, 0) if vertical else (0, 1)
    u, v = points[:, iu], points[:, iv]
    var_u, var_v, cov_uv = covs[:, iu, iu], covs[:, iv, iv], covs[:, iu, iv]
    w = 1.0 / (var_v - cov_uv**2 / var_u)  # eq. 13 or 15

    center = np.average(u, weights=w)
    design = np.stack([u - center, np.ones_like(u)], axis=-1)
    root = np.sqrt(w)[:, None]
    (slope, intercept), *_ = np.linalg.lstsq(design * root, v * root[:, 0], rcond=None)

    if form == "paper":
        cov = np.diag(1.0 / np.array([(w * (u - center) ** 2).sum(), w.sum()]))
    else:
        normal = np.array([-slope, 1.0])
        effective = np.array([normal @ c[np.ix_([iu, iv], [iu, iv])] @ normal for c in covs])
        gain = np.linalg.inv(design.T @ (w[:, None] * design)) @ (design * w[:, None]).T
        cov = gain @ np.diag(effective) @ gain.T
        misfit = ((v - design @ [slope, intercept]) ** 2 / effective).sum()
        freedom = len(u) - 2
        if freedom > 0:
            cov = cov * max(1.0, misfit / (freedom + 3.0 * np.sqrt(2.0 * freedom)))

    direction = np.zeros(2)
    direction[iu], direction[iv] = 1.0, slope
    direction /= np.linalg.norm(direction)
    foot = np.zeros(2)
    foot[iu], foot[iv] = center, intercept
    ends = np.array([foot + direction * (direction @ (p - foot)) for p in (points[0], points[-1])])
    return vertical, float(slope), float(intercept), float(center), cov, ends


def intersect(a, b):
    """Intersection as the solution of two equations, its covariance by their implicit derivative."""

    def equation(line):
        # normal . p = offset with p = (x, y); derivative of (normal . p - offset) by slope and intercept.
        normal = np.array([1.0, -line.slope]) if line.vertical else np.array([-line.slope, 1.0])
        return normal, line.intercept - line.slope * line.center

    (normal_a, offset_a), (normal_b, offset_b) = equation(a), equation(b)
    matrix = np.array([normal_a, normal_b])
    position = np.linalg.solve(matrix, [offset_a, offset_b])
    by_params = np.zeros((2, 4))
    for row, line in enumerate((a, b)):
        abscissa = position[1] if line.vertical else position[0]
        by_params[row, 2 * row] = -(abscissa - line.center)
        by_params[row, 2 * row + 1] = -1.0
    jacobian = -np.linalg.solve(matrix, by_params)
    joint = np.zeros((4, 4))
    joint[:2, :2], joint[2:, 2:] = a.cov, b.cov
    return position, jacobian @ joint @ jacobian.T


def extract(ranges, angles, model, config):
    """Lines and corners of a scan; ``model`` and ``config`` are read by attribute only."""
    sigma_range, sigma_bearing = model.sigma_range, model.sigma_bearing
    everything = _counter_clockwise(angles)
    spacing = _spacing(angles)
    beams = np.array(
        [k for k in everything if ranges[k] > 0.0 and model.range_min <= ranges[k] <= model.range_max], np.int64
    )
    if len(beams) < config.min_points:
        return [], []
    rho, theta = ranges[beams], angles[beams]
    points = np.stack([rho * np.cos(theta), rho * np.sin(theta)], axis=-1)
    n = len(beams)

    jump = [_jumps(rho, theta, i, (i + 1) % n, spacing, sigma_range, config) for i in range(n)]
    closed = not any(jump)
    if closed:
        start = int(np.argmax(rho))
        clusters = [[(start + k) % n for k in range(n + 1)]]
    else:
        start = jump.index(True) + 1
        clusters = [[]]
        for k in range(n):
            i = (start + k) % n
            clusters[-1].append(i)
            if jump[i]:
                clusters.append([])

    lines, joints = [], []
    for cluster in clusters:
        if len(cluster) < 2:
            continue
        for segment in _merge(_iepf(cluster, points, rho, model, config), points, rho, model, config):
            kept = _trim(segment, points, config.trim_points, config.trim_sigmas * sigma_range)
            if len(kept) < config.min_points:
                continue
            if np.linalg.norm(points[kept[-1]] - points[kept[0]]) < config.min_length_m:
                continue
            fitted = fit_line(rho[kept], theta[kept], sigma_range, sigma_bearing, config.covariance)
            lines.append(TwinLine(*fitted, beams=(int(beams[kept[0]]), int(beams[kept[-1]])), count=len(kept)))
            joints.append(segment)

    corners = []
    for k, line in enumerate(lines):
        if k + 1 == len(lines) and not closed:
            break
        follower = (k + 1) % len(lines)
        if follower == k:
            break
        before, after = joints[k], joints[follower]
        if before[-1] != after[0]:
            continue
        corner = _corner(line, lines[follower], points[before[-2:]], points[after[:2]], config)
        if corner is not None:
            corners.append(corner)
    return lines, corners


def _counter_clockwise(angles):
    """Beams as they are where they rise through less than a turn, reversed where they fall, else sorted."""
    steps = np.diff(angles)
    beams = np.arange(len(angles))
    if len(angles) and abs(angles[-1] - angles[0]) < 2.0 * np.pi:
        if (steps >= 0.0).all():
            return beams
        if (steps <= 0.0).all():
            return beams[::-1]
    return np.array(sorted(beams, key=lambda beam: angles[beam] % (2.0 * np.pi)), dtype=np.int64)


def _spacing(angles):
    """Mean angle between neighbours over the arc that is left when the largest gap of the circle is taken out."""
    if len(angles) < 2:
        return 0.0
    on_circle = np.sort(angles % (2.0 * np.pi))
    gaps = np.append(np.diff(on_circle), on_circle[0] + 2.0 * np.pi - on_circle[-1])
    return (2.0 * np.pi - gaps.max()) / (len(angles) - 1)


def _jumps(rho, theta, i, k, spacing, sigma_range, config):
    """Borges and Aldon's adaptive break point, and a limit on the gap between beams."""
    jump_angle = np.radians(config.jump_angle_deg)
    gap = (theta[k] - theta[i]) % (2.0 * np.pi)
    if len(rho) == 1 or gap > config.gap_beams * spacing or gap >= jump_angle:
        return True
    limit = min(rho[i], rho[k]) * np.sin(gap) / np.sin(jump_angle - gap) + config.split_sigmas * sigma_range
    return abs(rho[k] * np.exp(1j * gap) - rho[i]) > limit


def _iepf(indices, points, rho, model, config):
    """Segments of a cluster: lists of indices, neighbours share the breaking point."""
    worst = _worst(indices, points, rho, model, config)
    if worst is None:
        return [indices]
    left = _iepf(indices[: worst + 1], points, rho, model, config)
    return left + _iepf(indices[worst:], points, rho, model, config)


def _merge(segments, points, rho, model, config):
    """From the first to the last, a segment takes in its successor where no point would split the two together."""
    merged = [segments[0]]
    for segment in segments[1:]:
        together = merged[-1] + segment[1:]
        if _worst(together, points, rho, model, config) is None:
            merged[-1] = together
        else:
            merged.append(segment)
    return merged


def _worst(indices, points, rho, model, config):
    """Place in ``indices`` of the point that is farthest beyond its threshold from the chord, None where none is."""
    if len(indices) < 3:
        return None
    a, b = points[indices[0]], points[indices[-1]]
    length = np.linalg.norm(b - a)
    inner = points[indices[1:-1]]
    squared_rho = rho[indices[1:-1]] ** 2
    if length > 0.0:
        normal = np.array([a[1] - b[1], b[0] - a[0]]) / length
        distance = np.abs((inner - a) @ normal)
        # Variance of a point along the normal: n' C n.
        radial = (inner @ normal) ** 2 / squared_rho
        variance = model.sigma_range**2 * radial + squared_rho * model.sigma_bearing**2 * (1.0 - radial)
    else:
        distance = np.linalg.norm(inner - a, axis=1)
        variance = squared_rho * model.sigma_bearing**2
    sigma = np.sqrt(np.maximum(variance, model.sigma_range**2))
    threshold = np.maximum(config.split_distance_mm * 1e-3, config.split_sigmas * sigma)
    worst = int(np.argmax(distance / threshold))
    return worst + 1 if distance[worst] > threshold[worst] else None


def _trim(segment, points, count, distance):
    first, last = segment[0], segment[-1]
    a, b = count, len(segment) - 1 - count
    while a <= b and np.linalg.norm(points[segment[a]] - points[first]) < distance:
        a += 1
    while b >= a and np.linalg.norm(points[segment[b]] - points[last]) < distance:
        b -= 1
    return segment[a : b + 1]


def _corner(a, b, last_two, first_two, config):
    arm_a, arm_b = a.ends[0] - a.ends[1], b.ends[1] - b.ends[0]
    arm_a, arm_b = arm_a / np.linalg.norm(arm_a), arm_b / np.linalg.norm(arm_b)
    opening_angle = float(np.arccos(np.clip(arm_a @ arm_b, -1.0, 1.0)))
    if not np.radians(config.corner_angle_min_deg) <= opening_angle <= np.radians(config.corner_angle_max_deg):
        return None
    position, cov = intersect(a, b)
    spacing = max(np.linalg.norm(np.diff(pair, axis=0)) for pair in (last_two, first_two))
    if np.linalg.norm(position - first_two[0]) > config.corner_gap_mm * 1e-3 + spacing:
        return None
    bisector = arm_a + arm_b
    # The scan runs counter-clockwise: seen from the sensor a room's corner turns left, a pillar's right.
    convex = bool(np.linalg.det(np.array([arm_a, arm_b])) > 0.0)
    return TwinCorner(position, cov, opening_angle, float(np.arctan2(bisector[1], bisector[0])), convex)
