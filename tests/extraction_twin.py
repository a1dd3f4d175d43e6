"""Plain twin of the compiled extraction: the same rules, written again from their definitions and with matrices.

Shares no code with ``features`` and imports nothing of it.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

Y_ON_X, X_ON_Y, POLAR = range(3)


@dataclass(frozen=True)
class TwinLine:
    """A line in one of the three forms, the beams at its ends and the number of its points."""

    form: int
    params: np.ndarray
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


@dataclass
class _Wall:
    """Points of a segment: its breaking points, those that are fitted, whether the next one goes on from it."""

    first: int
    last: int
    begin: int = 0
    end: int = -1
    joined: bool = False
    rough: tuple | None = None


def cartesian_cov(rho, theta, sigma_range, sigma_bearing):
    """Eq. 9-10 as the product A C A'; stacked where rho and theta are arrays."""
    c, s = np.cos(theta), np.sin(theta)
    axes = np.moveaxis(np.array([[c, -s], [s, c]]), (0, 1), (-2, -1))
    polar = np.zeros(axes.shape)
    polar[..., 0, 0], polar[..., 1, 1] = sigma_range**2, (rho * sigma_bearing) ** 2
    return axes @ polar @ np.swapaxes(axes, -1, -2)


def fit_line(ranges, angles, sigma_range, sigma_bearing, fit="effective-variance", covariance="propagated"):
    """Fit a line by any of the four methods: form, parameters, center, covariance, ends."""
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    covs = cartesian_cov(ranges, angles, sigma_range, sigma_bearing)
    n1, n2 = len(points) * ((points - points.mean(axis=0)) ** 2).sum(axis=0)
    axis_form = X_ON_Y if n2 > n1 else Y_ON_X
    if fit == "cwlf":
        form, (params, center, cov) = axis_form, _cwlf(points, covs, axis_form, covariance)
    elif fit == "effective-variance":
        form, (params, center, cov) = axis_form, _effective_variance(points, covs, axis_form)
    else:
        w = 1.0 / np.linalg.det(covs) if fit == "arras-siegwart" else np.ones(len(points))  # eq. 3
        form, params, center = POLAR, arras_siegwart(ranges, angles, w), 0.0
        cov = _polar_cov(ranges, angles, w, params[0], sigma_range, sigma_bearing)
    normal, offset = normal_form(form, params, center)
    distances = points @ normal - offset
    freedom = len(points) - 2
    if covariance == "propagated" and freedom > 0:
        misfit = (distances**2 / np.einsum("j,ijk,k->i", normal, covs, normal)).sum()
        cov = cov * max(1.0, misfit / (freedom + 3.0 * np.sqrt(2.0 * freedom)))
    ends = (points - np.outer(distances, normal) / (normal @ normal))[[0, -1]]
    return form, params, center, cov, ends


def normal_form(form, params, center):
    """Normal, not of length one for a regression, and offset: the line is normal . p = offset."""
    if form == POLAR:
        return np.array([np.cos(params[0]), np.sin(params[0])]), params[1]
    slope, intercept = params
    normal = np.array([1.0, -slope]) if form == X_ON_Y else np.array([-slope, 1.0])
    return normal, intercept - slope * center


def _cwlf(points, covs, form, covariance):
    """Eq. 20-35 by least squares with a design matrix."""
    iu, iv = (1, 0) if form == X_ON_Y else (0, 1)
    u, v = points[:, iu], points[:, iv]
    var_u, var_v, cov_uv = covs[:, iu, iu], covs[:, iv, iv], covs[:, iu, iv]
    w = 1.0 / (var_v - cov_uv**2 / var_u)  # eq. 13 or 15
    center = np.average(u, weights=w)
    design = np.stack([u - center, np.ones_like(u)], axis=-1)
    root = np.sqrt(w)[:, None]
    params = np.linalg.lstsq(design * root, v * root[:, 0], rcond=None)[0]
    if covariance == "paper":
        return params, center, np.diag(1.0 / np.array([(w * (u - center) ** 2).sum(), w.sum()]))
    normal = np.empty(2)
    normal[iu], normal[iv] = -params[0], 1.0
    effective = np.einsum("j,ijk,k->i", normal, covs, normal)
    gain = np.linalg.inv(design.T @ (w[:, None] * design)) @ (design * w[:, None]).T
    return params, center, gain @ np.diag(effective) @ gain.T


def likelihood_residuals(points, covs, alpha, r):
    """(n . p_i - r) / sqrt(n' C_i n), n = (cos alpha, sin alpha); half their squared sum is -log of the likelihood."""
    normal = np.array([np.cos(alpha), np.sin(alpha)])
    return (points @ normal - r) / np.sqrt(np.einsum("j,ijk,k->i", normal, covs, normal))


def _effective_variance(points, covs, form):
    """Least squares of the likelihood's residuals in alpha and r, differentiated by complex steps, then rewritten."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][1]
    alpha, r = np.arctan2(normal[1], normal[0]), 0.0  # r from the middle
    h = 1e-30

    def residuals(a, d):
        n = np.array([np.cos(a), np.sin(a)])
        return ((points - middle) @ n - d) / np.sqrt(np.einsum("j,ijk,k->i", n, covs, n))

    for _ in range(100):
        jacobian = np.stack([residuals(alpha + h * 1j, r).imag, residuals(alpha, r + h * 1j).imag], axis=-1) / h
        step = np.linalg.lstsq(jacobian, -residuals(alpha, r), rcond=None)[0]
        alpha, r = alpha + step[0], r + step[1]
        if (jacobian @ step) @ (jacobian @ step) < 1e-24:
            break
    cov = np.linalg.inv(jacobian.T @ jacobian)
    # x cos(alpha) + y sin(alpha) = r about the middle is v = m u + b with these m and b.
    iu, iv = (1, 0) if form == X_ON_Y else (0, 1)
    normal = np.array([np.cos(alpha), np.sin(alpha)])
    turned = np.array([-np.sin(alpha), np.cos(alpha)])
    slope, height = -normal[iu] / normal[iv], r / normal[iv]
    change = np.array(
        [
            [(-turned[iu] * normal[iv] + normal[iu] * turned[iv]) / normal[iv] ** 2, 0.0],
            [-r * turned[iv] / normal[iv] ** 2, 1.0 / normal[iv]],
        ]
    )
    return np.array([slope, middle[iv] + height]), middle[iu], change @ cov @ change.T


def arras_siegwart(rho, theta, w):
    """Eq. 16-17 with the double sums as they are printed: alpha and r, r not negative."""
    products = np.outer(w * rho, w * rho)
    numerator = 2.0 / w.sum() * (products * np.outer(np.sin(theta), np.cos(theta))).sum()
    numerator -= (w * rho**2 * np.sin(2.0 * theta)).sum()
    denominator = (products * np.cos(theta[:, None] + theta)).sum() / w.sum() - (w * rho**2 * np.cos(2.0 * theta)).sum()
    alpha = np.arctan2(numerator, denominator) / 2.0
    r = (w * rho * np.cos(theta - alpha)).sum() / w.sum()
    return np.array([alpha, r]) if r >= 0.0 else np.array([alpha + (np.pi if alpha <= 0.0 else -np.pi), -r])


def _polar_cov(rho, theta, w, alpha, sigma_range, sigma_bearing):
    """Eq. 19 at fixed weights; derivatives by finite differences of fourth order, a thousandth of the wall wide."""
    points = np.stack([rho * np.cos(theta), rho * np.sin(theta)], axis=-1)
    wide = 1e-3 * np.linalg.norm(np.ptp(points, axis=0))

    def line(moved_rho, moved_theta):
        # Rows are moved measurements; the normal is the one on the side of alpha.
        x, y = moved_rho * np.cos(moved_theta), moved_rho * np.sin(moved_theta)
        mean_x, mean_y = x @ w / w.sum(), y @ w / w.sum()
        x, y = x - mean_x[:, None], y - mean_y[:, None]
        turned = np.arctan2(-2.0 * (x * y) @ w, (y**2 - x**2) @ w) / 2.0
        turned = alpha + (turned - alpha + np.pi / 2.0) % np.pi - np.pi / 2.0
        return np.stack([turned, mean_x * np.cos(turned) + mean_y * np.sin(turned)])

    def derivative(move, steps):
        near, far = (move(width) - move(-width) for width in (np.diag(steps), 2.0 * np.diag(steps)))
        return (8.0 * near - far) / (12.0 * steps)

    by_range = derivative(lambda moved: line(rho + moved, np.broadcast_to(theta, moved.shape)), np.full(len(rho), wide))
    by_bearing = derivative(lambda moved: line(np.broadcast_to(rho, moved.shape), theta + moved), wide / rho)
    return sigma_range**2 * by_range @ by_range.T + sigma_bearing**2 * by_bearing @ by_bearing.T


def intersect(a, b):
    """Intersection as the solution of two equations, its covariance by their implicit derivative."""
    (normal_a, offset_a), (normal_b, offset_b) = (normal_form(each.form, each.params, each.center) for each in (a, b))
    matrix = np.array([normal_a, normal_b])
    position = np.linalg.solve(matrix, [offset_a, offset_b])
    # Derivative of (normal . p - offset) by the parameters.
    by_params = np.zeros((2, 4))
    for row, (line, normal) in enumerate(((a, normal_a), (b, normal_b))):
        if line.form == POLAR:
            by_params[row, 2 * row] = position @ [-normal[1], normal[0]]
        else:
            by_params[row, 2 * row] = line.center - position[1 if line.form == X_ON_Y else 0]
        by_params[row, 2 * row + 1] = -1.0
    jacobian = -np.linalg.solve(matrix, by_params)
    joint = np.zeros((4, 4))
    joint[:2, :2], joint[2:, 2:] = a.cov, b.cov
    return position, jacobian @ joint @ jacobian.T


def extract(ranges, angles, model, config, arcs=None):
    """Lines and corners of a scan; ``model`` and ``config`` are read by attribute only.

    To ``arcs`` go, for each arc that is iterated, its misfit, that of the best arc, and the limit (eq. M105).
    """
    arcs = [] if arcs is None else arcs
    sigma_range, sigma_bearing = model.sigma_range, model.sigma_bearing
    everything = _counter_clockwise(angles)
    spacing = _spacing(angles)
    beams = np.array(
        [k for k in everything if ranges[k] > 0.0 and model.range_min <= ranges[k] <= model.range_max], np.int64
    )
    n = len(beams)
    if n < config.min_points:
        return [], []
    rho, theta = ranges[beams], angles[beams]
    jump = np.array([_jumps(rho, theta, i, (i + 1) % n, spacing, sigma_range, config) for i in range(n)])
    closed = not jump.any()
    # Lines begin at the first beam, at the first jump where a segment lies across the end of the scan.
    start = int(np.argmax(rho)) if closed else 0 if jump[-1] else int(np.argmax(jump)) + 1
    chain = (start + np.arange(n + closed)) % n
    beams, rho, theta = beams[chain], rho[chain], theta[chain]
    points = np.stack([rho * np.cos(theta), rho * np.sin(theta)], axis=-1)
    cuts = np.flatnonzero(jump[chain[:n]]) + 1
    clusters = np.split(np.arange(len(chain)), cuts)

    segments = []
    for cluster in clusters:
        if len(cluster) >= config.min_points:
            segments += _merge(_iepf(list(cluster), points, rho, model, config), points, rho, model, config)
    walls = [_Wall(int(each[0]), int(each[-1])) for each in segments]
    for wall, after in itertools.pairwise(walls):
        wall.joined = wall.last == after.first
    if walls:
        walls[-1].joined = closed
    walls = _without_stubs(walls, points, sigma_range, config)
    _settle(walls, points, spacing, model, config)
    walls = [piece for wall in walls for piece in _straight_pieces(wall, points, model, config)]
    walls = _without_stubs(walls, points, sigma_range, config)
    _settle(walls, points, spacing, model, config)

    lines, fitted, bends = [], [], []
    for k, wall in enumerate(walls):
        first, last = wall.begin, wall.end
        if last - first + 1 < config.min_points or _is_short(points[first], points[last], sigma_range, config):
            continue
        kept = slice(first, last + 1)
        line = fit_line(rho[kept], theta[kept], sigma_range, sigma_bearing, config.fit, config.covariance)
        lines.append(TwinLine(*line, beams=(int(beams[first]), int(beams[last])), count=last - first + 1))
        fitted.append(k)
        bends.append(_bend(points[kept], wall.rough, model, config))

    neighbours = [
        (i, follower)
        for i, k in enumerate(fitted)
        for follower in [(i + 1) % len(fitted)]
        if follower != i and walls[k].joined and fitted[follower] == (k + 1) % len(walls)
    ]
    arms, parted = {}, []
    for i, follower in neighbours:
        a, b = walls[fitted[i]], walls[fitted[follower]]
        # In a closed contour the points of the first wall follow those of the last one; the cut is one point of both.
        between = np.arange(a.begin, b.end + 1) if follower else np.r_[a.begin : len(points), 1 : b.end + 1]
        arms[i] = points[between]
        along_a, along_b = (line.ends[1] - line.ends[0] for line in (lines[i], lines[follower]))
        turn = np.pi - _angle(-along_a, along_b)
        if _cross(*_normals(lines[i], lines[follower])):
            position, _ = intersect(lines[i], lines[follower])
            if _may_be_arc(arms[i], position, lines[i], lines[follower], model, config, arcs):
                lengths = np.array([np.linalg.norm(along_a), np.linalg.norm(along_b)])
                curvature = 2.0 * turn / lengths.sum()
                for j, length in zip((i, follower), lengths, strict=True):
                    bends[j] = max(bends[j], length**2 / 12.0 * curvature)
                parted.append((i, follower))
    lines = [_bent(line, bend) for line, bend in zip(lines, bends, strict=True)]

    corners = []
    for i, follower in neighbours:
        if (i, follower) in parted:
            continue
        ends = points[walls[fitted[i]].last], points[walls[fitted[follower]].first]
        bent = bends[i], bends[follower]
        corner = _corner(lines[i], lines[follower], ends, bent, arms[i], spacing, model, config)
        if corner is not None:
            corners.append(corner)
    return lines, corners


def _without_stubs(walls, points, sigma_range, config):
    """Walls that may be lines; each is joined to the next where all that was left out between them was joined."""
    least = config.min_points + 2 * config.trim_points
    kept = [
        i
        for i, each in enumerate(walls)
        if each.last - each.first + 1 >= least
        and not _is_short(points[each.first], points[each.last], sigma_range, config)
    ]
    joined = [wall.joined for wall in walls]
    for i, j in itertools.pairwise(kept):
        walls[i].joined = all(joined[i:j])
    if kept:
        walls[kept[-1]].joined = all(joined[kept[-1] :] + joined[: kept[0]])
    return [walls[i] for i in kept]


def _settle(walls, points, spacing, model, config):
    """Fit preliminary lines, then move the breaks to where the walls meet (eq. M25)."""
    trim = config.trim_sigmas * model.sigma_range
    for wall in walls:
        wall.begin, wall.end = _trim(range(wall.first, wall.last + 1), points, config.trim_points, trim)
        wall.rough = _rough(points[wall.begin : wall.end + 1]) if wall.end > wall.begin else None
    for k, a in enumerate(walls):
        follower = (k + 1) % len(walls)
        b = walls[follower]
        if follower == k or not a.joined or a.rough is None or b.rough is None:
            continue
        matrix = np.array([a.rough[0], b.rough[0]])
        if _cross(*matrix) == 0.0:
            continue
        position = np.linalg.solve(matrix, [a.rough[1], b.rough[1]])
        near = [_misfit(points, *wall.rough, model) <= config.near_sigmas**2 for wall in (a, b)]
        last, first = _move_break((a.begin, a.last, b.first, b.end), follower == 0, points, position, near)
        between = np.r_[last + 1 : len(points), 0:first] if follower == 0 else np.arange(last + 1, first)
        a.joined = (
            _reaches(points[last], position, a.rough[0], spacing, model, config)
            and _reaches(points[first], position, b.rough[0], spacing, model, config)
            and all(near[0][i] or near[1][i] for i in between)
        )
        if a.joined:
            a.last, b.first = last, first
            away = np.linalg.norm(points - position, axis=1) >= trim
            a.end = _step_back(last - config.trim_points, a.begin, away)
            b.begin = _step_back(first + config.trim_points, b.end, away)


def _variance(points, normal, model):
    """Variance of each point along a unit normal, n' C n (eq. M3)."""
    covs = cartesian_cov(
        np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]), model.sigma_range, model.sigma_bearing
    )
    return np.einsum("j,ijk,k->i", normal, covs, normal)


def _misfit(points, normal, offset, model):
    """Squared distance of each point from a line over its variance."""
    return (points @ normal - offset) ** 2 / _variance(points, normal, model)


def _hits(points, normal, offset):
    """Abscissas where the beams meet a line; those of the points whose beams run nearly along it."""
    away = np.abs(points @ normal - offset) < 0.5 * np.abs(points @ normal)
    beams = points / np.linalg.norm(points, axis=1)[:, None]
    cosines = np.where(away, beams @ normal, 1.0)
    hits = np.where(away[:, None], beams * (offset / cosines)[:, None], points)
    return hits @ [-normal[1], normal[0]]


def _unexplained(abscissas, values, weights):
    """Values less their weighted regression line."""
    roots = np.sqrt(weights)
    basis = np.linalg.qr(np.stack([np.ones_like(abscissas), abscissas - abscissas.mean()], axis=-1) * roots[:, None])[0]
    return values - basis @ (basis.T @ (values * roots)) / roots


def _straight_pieces(wall, points, model, config):
    """Split a wall for as long as two lines explain its points better than one (eq. M101)."""
    n = wall.end - wall.begin + 1
    if n < 4:
        return [wall]
    fitted = points[wall.begin : wall.end + 1]
    normal, _ = _rough(fitted)
    along, across = _hits(fitted, *_rough(fitted)), fitted @ normal
    weights = 1.0 / _variance(fitted, normal, model)

    def chi2(part):
        return (weights[part] * _unexplained(along[part], across[part], weights[part]) ** 2).sum()

    gains = [chi2(slice(None)) - chi2(slice(k)) - chi2(slice(k, None)) for k in range(2, n - 1)]
    if max(gains) <= 2.0 * np.log(n / config.straight_level):
        return [wall]
    last = wall.begin + 1 + int(np.argmax(gains))
    parts = (
        _Wall(wall.first, last, wall.begin, last, True),
        _Wall(last + 1, wall.last, last + 1, wall.end, wall.joined),
    )
    return [piece for part in parts for piece in _straight_pieces(part, points, model, config)]


def _bend(points, rough, model, config):
    """How far the ends of a wall bend away from its line, 0 where chance may do that (eq. M102)."""
    normal, offset = rough
    along, weights = _hits(points, *rough), 1.0 / _variance(points, normal, model)
    along = along - along.mean()
    square = _unexplained(along, along**2, weights)
    information = (weights * square**2).sum()
    if len(points) < 3 or information <= 1e-12 * (weights * along**4).sum():
        return 0.0
    coefficient = (weights * square * (points @ normal - offset)).sum() / information
    if abs(coefficient) * np.sqrt(information) <= config.bend_sigmas:
        return 0.0
    return float(abs(coefficient) * np.abs(square[[0, -1]]).max())


def _bent(line, bend):
    """The line with the bend at its ends, across it, in the variance of its offset (eq. M102)."""
    normal, _ = normal_form(line.form, line.params, line.center)
    return replace(line, cov=line.cov + np.diag([0.0, bend**2 * (normal @ normal)]))


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _angle(a, b):
    return float(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))


def _normals(*lines):
    return [normal_form(line.form, line.params, line.center)[0] for line in lines]


def _unit_form(line):
    """Unit normal and offset of a fitted line."""
    normal, offset = normal_form(line.form, line.params, line.center)
    return normal / np.linalg.norm(normal), offset / np.linalg.norm(normal)


def _gap(end, position, normal, model):
    """Distance along a wall from its last point to a position, and the standard deviation of a point there."""
    along = np.array([-normal[1], normal[0]])
    return abs(along @ (end - position)), np.sqrt(_variance(position[None], along, model)[0])


def _reaches(end, position, normal, spacing, model, config):
    """Of a wall that goes on to the position the next beam would hit a point beyond it (eq. M103)."""
    gap, sigma = _gap(end, position, normal, model)
    distance = np.linalg.norm(position)
    cosine = max(abs(normal @ position) / distance, 1e-6)
    return gap <= distance * spacing / cosine + config.end_sigmas * sigma


def _behind(points, position):
    """Whether each point is counter-clockwise of the position."""
    return _cross(position, points.T) > 0.0


def _walls_end(points, position, wall_a, wall_b, model, config):
    """Whether no beam passes the end of a wall and hits the other one behind it (eq. M104)."""
    before = np.flatnonzero(~_behind(points, position))
    split = int(before[-1]) + 1 if len(before) else 1
    differences = _misfit(points, *wall_a, model) - _misfit(points, *wall_b, model)
    limit = 2.0 * np.log(1.0 / config.corner_level)
    for outwards in (differences[:split][::-1], -differences[split:]):
        sums = np.cumsum(outwards)
        # A test that is decided for the wall ends.
        over = np.flatnonzero(sums < -100.0)
        if (sums[: int(over[0]) if len(over) else len(sums)] > limit).any():
            return False
    return True


def _may_be_arc(points, position, line_a, line_b, model, config, arcs):
    """Whether an arc explains the points as well as two walls that meet at the position (eq. M105)."""
    wall_a, wall_b = _unit_form(line_a), _unit_form(line_b)
    corner = np.where(_behind(points, position), _misfit(points, *wall_b, model), _misfit(points, *wall_a, model)).sum()
    limit = corner + 2.0 * np.log(len(points) / config.straight_level)
    # The algebraic fit: x^2 + y^2 = 2 c . p + (r^2 - c^2), about the middle of the points.
    middle = points.mean(axis=0)
    design = np.column_stack([2.0 * (points - middle), np.ones(len(points))])
    solution = np.linalg.lstsq(design, ((points - middle) ** 2).sum(axis=1), rcond=None)[0]
    start = np.array([*(middle + solution[:2]), np.sqrt(solution[2] + solution[:2] @ solution[:2])])

    def residuals(arc, variances=None):
        away = points - arc[:2]
        distances = np.linalg.norm(away, axis=1)
        variances = arc_variances(arc) if variances is None else variances
        return (distances - arc[2]) / np.sqrt(variances)

    def arc_variances(arc):
        normals = points - arc[:2]
        normals = normals / np.linalg.norm(normals, axis=1)[:, None]
        covs = cartesian_cov(
            np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0]), model.sigma_range, model.sigma_bearing
        )
        return np.einsum("ij,ijk,ik->i", normals, covs, normals)

    if (residuals(start) ** 2).sum() > 10.0 * limit:
        return False
    arc = start
    for _ in range(2):
        held = arc_variances(arc)
        away = (points - arc[:2]) / np.linalg.norm(points - arc[:2], axis=1)[:, None]
        jacobian = -np.column_stack([away, np.ones(len(points))]) / np.sqrt(held)[:, None]
        arc = arc + np.linalg.lstsq(jacobian, -residuals(arc, held), rcond=None)[0]
        if (residuals(arc) ** 2).sum() > 10.0 * limit:
            return False
    iterated = (residuals(arc) ** 2).sum()
    best = 2.0 * scipy.optimize.least_squares(residuals, arc, x_scale="jac").cost
    arcs.append((iterated, best, limit))
    return iterated <= limit


def _is_short(first, last, sigma_range, config):
    return np.linalg.norm(last - first) < min(config.min_length_m, config.min_length_sigmas * sigma_range)


def _rough(points):
    """Unit normal and offset of the total-least-squares line."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][1]
    return normal, normal @ middle


def _move_break(bounds, fixed, points, position, near):
    """Last point of the first wall and first of the second, searched from the break outwards.

    A point changes sides where the wall that takes it is near; at the cut of a closed contour points are only lost.
    """
    begin, last, first, end = bounds

    def behind(i):
        return points[i][0] * position[1] - points[i][1] * position[0] < 0.0  # the point, of the position

    while last > begin and behind(last) and (fixed or near[1][last]):
        last -= 1
    while first < end and not behind(first) and (fixed or near[0][first]):
        first += 1
    if not fixed:
        if last == bounds[1]:
            while last + 1 < end and not behind(last + 1) and near[0][last + 1]:
                last += 1
        if first == bounds[2]:
            while first - 1 > begin and behind(first - 1) and near[1][first - 1]:
                first -= 1
    return last, first


def _step_back(index, limit, away):
    while index != limit and not away[index]:
        index += 1 if limit > index else -1
    return index


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
    gap = (theta[k] - theta[i]) % (2.0 * np.pi)
    if len(rho) == 1 or gap > config.gap_beams * spacing or gap >= np.pi:
        return True
    limit = (
        min(rho[i], rho[k]) * np.sin(gap) / np.sin(np.radians(config.jump_angle_deg))
        + config.split_sigmas * sigma_range
    )
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
    """First and last point that are ``count`` points and ``distance`` away from the ends; the far end where none is."""
    apart = [np.linalg.norm(points[segment] - points[end], axis=1) >= distance for end in (segment[0], segment[-1])]
    n = len(segment)
    a = next((k for k in range(min(count, n - 1), n) if apart[0][k]), n - 1)
    b = next((k for k in range(max(n - 1 - count, 0), -1, -1) if apart[1][k]), 0)
    return [int(segment[a]), int(segment[b])]


def _corner(a, b, ends, bends, points, spacing, model, config):
    arm_a, arm_b = a.ends[0] - a.ends[1], b.ends[1] - b.ends[0]
    arm_a, arm_b = arm_a / np.linalg.norm(arm_a), arm_b / np.linalg.norm(arm_b)
    opening_angle = _angle(arm_a, arm_b)
    if not np.radians(config.corner_angle_min_deg) <= opening_angle <= np.radians(config.corner_angle_max_deg):
        return None
    # An arc that turns as much from end to end runs into the other wall.
    for line, bend in zip((a, b), bends, strict=True):
        if np.pi - opening_angle <= 12.0 * bend / np.linalg.norm(line.ends[1] - line.ends[0]):
            return None
    position, cov = intersect(a, b)
    walls = _unit_form(a), _unit_form(b)
    for end, (normal, _) in zip(ends, walls, strict=True):
        if not _reaches(end, position, normal, spacing, model, config):
            return None
        # The wall may end in the gap: a mixture of two corners (eq. M103).
        gap, sigma = _gap(end, position, normal, model)
        unseen = max(0.0, gap - config.end_sigmas * sigma)
        along = np.array([-normal[1], normal[0]])
        cov = cov + config.unseen_end / 3.0 * unseen**2 * np.outer(along, along)
    if not _walls_end(points, position, *walls, model, config):
        return None
    bisector = arm_a + arm_b
    # The scan runs counter-clockwise: seen from the sensor a room's corner turns left, a pillar's right.
    convex = bool(_cross(arm_a, arm_b) > 0.0)
    return TwinCorner(position, cov, opening_angle, float(np.arctan2(bisector[1], bisector[0])), convex)
