# pyright: standard
"""The compiled part of a registration: association of beams with walls, information and gradient of the pose."""

import math

import numpy as np
from numba import f8, i8

from features.compiled import inner, kernel
from slam.odometry.line_map import CENTER, LENGTH, NORMAL_X, NORMAL_Y, VAR_ANGLE, VAR_OFFSET, WALL_X, WALL_Y
from slam.odometry.scan_points import beams_on_wall, pseudo_angles

SUMS = {"reassoc", "contract", "arcp", "nsz"}
"""Freedom for the compiler in sums; NaN and infinity keep their meaning."""

WEIGHT, JACOBIAN_X, JACOBIAN_Y, JACOBIAN_TURN, RESIDUAL, CERTAINTY = range(6)
"""Sums over the walls behind a beam."""


@inner()
def _remove_spurious_information(information, pull, crookedness2):
    """Remove the spurious information on the position along nearly parallel walls of erroneous directions (eq. M30)."""
    if information[2, 2] <= 0.0:
        return
    # With the heading that is best for each position; what is left is of the position alone.
    arm_x = information[0, 2] / information[2, 2]
    arm_y = information[1, 2] / information[2, 2]
    xx = information[0, 0] - arm_x * information[0, 2]
    xy = information[0, 1] - arm_x * information[1, 2]
    yy = information[1, 1] - arm_y * information[1, 2]
    middle = 0.5 * (xx + yy)
    half = math.hypot(0.5 * (xx - yy), xy)
    least = middle - half
    feigned = min(max(least, 0.0), crookedness2 * (middle + half))
    if feigned <= 0.0:
        return
    weak = 0.5 * math.atan2(-2.0 * xy, yy - xx)
    weak_x = math.cos(weak)
    weak_y = math.sin(weak)
    force = feigned / least * (weak_x * (pull[0] - arm_x * pull[2]) + weak_y * (pull[1] - arm_y * pull[2]))
    pull[0] -= force * weak_x
    pull[1] -= force * weak_y
    information[0, 0] -= feigned * weak_x * weak_x
    information[0, 1] -= feigned * weak_x * weak_y
    information[1, 0] -= feigned * weak_x * weak_y
    information[1, 1] -= feigned * weak_y * weak_y


@inner(fastmath=SUMS, forceinline=True)
def _associate_walls(
    points, directions, lines, normals, origin_x, origin_y, walls, pose, gate, reach, nearest, var_scatter,
    kernel2, cos_turn, cos_surface_turn, turned, beams, knowledge,
):  # fmt: skip
    """Sum the weighted walls of each beam, and the information of the walls on each line of the scan (eq. M28)."""
    beams[:] = 0.0
    knowledge[:] = 0.0
    n = directions.size
    met = np.empty(n, np.int64)
    residuals = np.empty(n)
    turnings = np.empty(n)
    met_by_line = np.zeros(len(knowledge), np.int64)
    c = math.cos(pose[2])
    s = math.sin(pose[2])
    for i in range(n):
        turned[i, 0] = c * points[i, 0] - s * points[i, 1]
        turned[i, 1] = s * points[i, 0] + c * points[i, 1]
        turned[i, 2] = c * normals[i, 0] - s * normals[i, 1]
        turned[i, 3] = s * normals[i, 0] + c * normals[i, 1]
    sensor_x = c * origin_x - s * origin_y
    sensor_y = s * origin_x + c * origin_y
    for k in range(len(walls)):
        normal_x = walls[k, NORMAL_X]
        normal_y = walls[k, NORMAL_Y]
        base_x = walls[k, WALL_X] - pose[0]
        base_y = walls[k, WALL_Y] - pose[1]
        arm_x = base_x - sensor_x
        arm_y = base_y - sensor_y
        # A wall has one face.
        if normal_x * arm_x + normal_y * arm_y > -nearest:
            continue
        half = 0.5 * walls[k, LENGTH] + reach
        lever = normal_y * base_x - normal_x * base_y
        lever_center = lever + walls[k, CENTER]
        certain_offset = 1.0 / walls[k, VAR_OFFSET]
        certain_angle = 1.0 / walls[k, VAR_ANGLE]
        begin, end = beams_on_wall(directions, arm_x, arm_y, normal_x, normal_y, half, c, s)
        count = 0
        for m in range(begin, end):
            i = m if m < n else m - n
            x = turned[i, 0]
            y = turned[i, 1]
            residual = normal_x * (x - base_x) + normal_y * (y - base_y)
            turning = normal_y * x - normal_x * y
            if abs(residual) > gate or abs(turning - lever) > half:
                continue
            line = lines[i]
            facing = normal_x * turned[i, 2] + normal_y * turned[i, 3]
            if facing < (cos_turn if line >= 0 else cos_surface_turn):
                continue
            met[count] = i
            residuals[count] = residual
            turnings[count] = turning
            count += 1
            if line >= 0:
                met_by_line[line] += 1
        for j in range(count):
            i = met[j]
            residual = residuals[j]
            turning = turnings[j]
            line = lines[i]
            # All that meets a wall shares what is known of it.
            part = (met_by_line[line] if line >= 0 else 1) / count
            arm = turning - lever_center
            variance = walls[k, VAR_OFFSET] + walls[k, VAR_ANGLE] * arm * arm
            # The Cauchy kernel, times the inverse of the variance.
            weight = kernel2 / (kernel2 * (variance + var_scatter) + residual * residual)
            robust = part * weight * (variance + var_scatter)
            beams[i, WEIGHT] += weight
            beams[i, JACOBIAN_X] += weight * normal_x
            beams[i, JACOBIAN_Y] += weight * normal_y
            beams[i, JACOBIAN_TURN] += weight * turning
            beams[i, RESIDUAL] += weight * residual
            if line >= 0:
                knowledge[line, 0] += robust * certain_offset
                knowledge[line, 1] += robust * certain_offset * lever_center
                knowledge[line, 2] += robust * (certain_offset * lever_center * lever_center + certain_angle)
            else:
                beams[i, CERTAINTY] += robust / variance
        for j in range(count):
            if lines[met[j]] >= 0:
                met_by_line[lines[met[j]]] = 0


@inner(fastmath=SUMS, forceinline=True)
def _accumulate(
    points, ranges, lines, origin_x, origin_y, beams, knowledge, heading, var_range, var_bearing, var_rough, spread,
    kernel2, inlier2, sums, information, gradient,
):  # fmt: skip
    """Fill information and gradient at the pose of the wall association; return the number of inliers (eq. M29)."""
    information[:] = 0.0
    gradient[:] = 0.0
    sums[:] = 0.0
    inliers = 0
    c = math.cos(heading)
    s = math.sin(heading)
    for i in range(ranges.size):
        weight = beams[i, WEIGHT]
        if weight == 0.0:
            continue
        by_x = beams[i, JACOBIAN_X] / weight
        by_y = beams[i, JACOBIAN_Y] / weight
        by_turn = beams[i, JACOBIAN_TURN] / weight
        residual = beams[i, RESIDUAL] / weight
        arm_x = points[i, 0] - origin_x
        arm_y = points[i, 1] - origin_y
        incidence = (by_x * (c * arm_x - s * arm_y) + by_y * (s * arm_x + c * arm_y)) / ranges[i]
        slant2 = max(0.0, 1.0 - incidence * incidence)
        variance = (
            var_range * incidence * incidence + var_bearing * ranges[i] * ranges[i] * slant2 + var_rough
        )  # eq. M3
        line = lines[i]
        wall = 0.0 if line >= 0 else 1.0 / beams[i, CERTAINTY]
        allowed = variance + wall + spread
        robust = 1.0 / (1.0 + residual * residual / (kernel2 * allowed))
        if residual * residual < inlier2 * allowed:
            inliers += 1
        if line < 0:
            _add(information, gradient, by_x, by_y, by_turn, robust / (variance + wall), residual)
            continue
        weight = robust / variance
        sums[line, 0] += weight
        sums[line, 1] += weight * by_x
        sums[line, 2] += weight * by_y
        sums[line, 3] += weight * by_turn
        sums[line, 4] += weight * by_turn * by_turn
        sums[line, 5] += weight * residual
        sums[line, 6] += weight * residual * by_turn
        sums[line, 7] += 1.0
    for line in range(len(sums)):
        total = sums[line, 0]
        if sums[line, 7] < 2.0:
            continue
        by_x = sums[line, 1] / total
        by_y = sums[line, 2] / total
        lever = sums[line, 3] / total
        offset = sums[line, 5] / total
        spread_lever = sums[line, 4] - total * lever * lever
        turn = (sums[line, 6] - total * lever * offset) / spread_lever
        # What the walls know, per point, with respect to offset and turn at this lever.
        known = knowledge[line, 0] / sums[line, 7]
        known_mixed = knowledge[line, 1] / sums[line, 7] - lever * known
        known_turn = knowledge[line, 2] / sums[line, 7] - lever * (2.0 * known_mixed + lever * known)
        determinant = known * known_turn - known_mixed * known_mixed
        cov_offset = 1.0 / total + known_turn / determinant
        cov_turn = 1.0 / spread_lever + known / determinant
        cov_mixed = -known_mixed / determinant
        determinant = cov_offset * cov_turn - cov_mixed * cov_mixed
        a = cov_turn / determinant
        b = -cov_mixed / determinant
        d = cov_offset / determinant
        # Jacobian of offset and turn by the pose: rows (by_x, by_y, lever) and (0, 0, 1).
        force = a * offset + b * turn
        information[0, 0] += a * by_x * by_x
        information[0, 1] += a * by_x * by_y
        information[1, 1] += a * by_y * by_y
        information[0, 2] += (a * lever + b) * by_x
        information[1, 2] += (a * lever + b) * by_y
        information[2, 2] += a * lever * lever + 2.0 * b * lever + d
        gradient[0] += force * by_x
        gradient[1] += force * by_y
        gradient[2] += force * lever + b * offset + d * turn
    information[1, 0] = information[0, 1]
    information[2, 0] = information[0, 2]
    information[2, 1] = information[1, 2]
    return inliers


@inner()
def _add(information, gradient, by_x, by_y, by_turn, weight, residual):
    information[0, 0] += weight * by_x * by_x
    information[0, 1] += weight * by_x * by_y
    information[1, 1] += weight * by_y * by_y
    information[0, 2] += weight * by_x * by_turn
    information[1, 2] += weight * by_y * by_turn
    information[2, 2] += weight * by_turn * by_turn
    gradient[0] += weight * by_x * residual
    gradient[1] += weight * by_y * residual
    gradient[2] += weight * by_turn * residual


@kernel(
    f8[:, ::1], f8[::1], i8[::1], f8[:, ::1], f8[:, ::1], f8, f8, f8, f8, f8[:, ::1], f8[::1],
    f8[:, ::1], f8[::1], f8, f8, f8, f8, f8, f8, f8, f8,
    f8, f8, f8, f8, f8, f8, i8, fastmath=SUMS,
)  # fmt: skip
def register_kernel(
    points, ranges, lines, normals, walls_robot, origin_x, origin_y, var_range, var_bearing, walls, prior,
    prior_cov, start, gate, final_gate, narrowing, gate_sigmas2, reach, nearest, var_scatter, var_rough, kernel2,
    inlier2, cos_turn, cos_surface_turn, crookedness2, step_limit2, max_iterations,
):  # fmt: skip
    """Fit a scan to walls; return pose, information, pull and the number of points on a wall (eq. M27-M31)."""
    n = ranges.size
    directions = pseudo_angles(points, origin_x, origin_y)
    turned = np.empty((n, 4))
    beams = np.empty((n, 6))
    knowledge = np.empty((len(walls_robot), 3))
    sums = np.empty((len(walls_robot), 8))
    information = np.empty((3, 3))
    gradient = np.empty(3)
    pose = start.copy()
    pull = np.zeros(3)
    inliers = 0
    for _ in range(max_iterations):
        last = gate <= final_gate
        # A wide gate admits wrong pairs: its variance is added to that of each residual.
        spread = 0.0 if last else gate * gate / gate_sigmas2
        _associate_walls(
            points, directions, lines, normals, origin_x, origin_y, walls, pose, gate, reach, nearest,
            max(var_scatter, spread), kernel2, cos_turn, cos_surface_turn, turned, beams, knowledge,
        )  # fmt: skip
        inliers = _accumulate(
            points, ranges, lines, origin_x, origin_y, beams, knowledge, pose[2], var_range, var_bearing, var_rough,
            spread, kernel2, inlier2, sums, information, gradient,
        )  # fmt: skip
        offset = pose - prior
        offset[2] = (offset[2] + math.pi) % (2.0 * math.pi) - math.pi
        pull = information @ offset - gradient
        _remove_spurious_information(information, pull, crookedness2)
        moved = np.linalg.solve(np.eye(3) + prior_cov @ information, prior_cov @ pull)
        step = moved - offset
        pose = prior + moved
        if last and step @ information @ step < step_limit2:
            break
        gate = max(final_gate, narrowing * gate)
    return pose, information, pull, inliers
