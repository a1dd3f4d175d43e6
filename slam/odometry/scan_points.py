# pyright: standard
"""The points of a scan in the order of their bearings, and the line that each belongs to."""

import math
from dataclasses import dataclass

import numpy as np
from numba import f8
from numpy.typing import NDArray

from features.compiled import READ_ONLY, inner, kernel
from features.returns import is_return
from features.scan import LaserScan
from features.se2 import TWO_PI, Array
from features.sensor import SensorModel
from slam.odometry.line_map import LENGTH, NORMAL_X, NORMAL_Y, WALL_X, WALL_Y
from slam.odometry.rules import SurfaceRules


@dataclass(frozen=True, slots=True, eq=False)
class ScanPoints:
    """Points of a scan that a registration works on.

    Parameters
    ----------
    points : robot frame, shape (n, 2) [m].
    ranges : shape (n,) [m].
    bearings : directions from the sensor in the axes of the robot, rising, shape (n,), in [-pi, pi) [rad].
    lines : index of the line of the scan that each point belongs to, -1 for none, shape (n,).
    normals : of the surface at each point, robot frame, towards the sensor, shape (n, 2): that of its line, else by the
        points beside it; NaN where these determine none.
    walls_robot : lines of the scan as walls, robot frame, shape (L, WALL_FIELDS).
    sensor : noise of a beam and mounting.
    """

    points: Array
    ranges: Array
    bearings: Array
    lines: NDArray[np.int64]
    normals: Array
    walls_robot: Array
    sensor: SensorModel

    def __len__(self) -> int:
        return self.ranges.size


def scan_points(
    scan: LaserScan,
    walls_robot: Array,
    sensor: SensorModel,
    distance: float,
    rules: SurfaceRules = SurfaceRules(),  # noqa: B008, frozen
) -> ScanPoints:
    """Points of a scan, with the line of each.

    Parameters
    ----------
    scan : sensor frame.
    walls_robot : lines of the scan as walls, robot frame, shape (L, WALL_FIELDS).
    sensor : limits, noise and mounting.
    distance : how far a point may lie from the line that it belongs to [m].
    rules : for the normals at points that belong to no line.
    """
    mounting = sensor.mounting
    points, ranges, bearings, lines, normals = _points_kernel(
        scan.ranges, scan.angles, sensor.range_min, sensor.range_max, mounting.x, mounting.y, mounting.theta,
        -1.0 if mounting.upside_down else 1.0, walls_robot, distance, rules.beside, rules.same_surface,
        rules.least_length,
    )  # fmt: skip
    return ScanPoints(points, ranges, bearings, lines, normals, walls_robot, sensor)


@inner()
def _normals(points, lines, walls_robot, origin_x, origin_y, beside, same_surface, least_length):
    n = len(points)
    normals = np.full((n, 2), np.nan)
    for i in range(n):
        if lines[i] >= 0:
            normals[i, 0] = walls_robot[lines[i], NORMAL_X]
            normals[i, 1] = walls_robot[lines[i], NORMAL_Y]
            continue
        # As far along the surface as it goes on, for the noise to matter little.
        first = last = i
        while first > 0 and _near(points, first, first - 1, same_surface) and _near(points, i, first, beside):
            first -= 1
        while last < n - 1 and _near(points, last, last + 1, same_surface) and _near(points, i, last, beside):
            last += 1
        x = points[last, 0] - points[first, 0]
        y = points[last, 1] - points[first, 1]
        length = math.hypot(x, y)
        if length < least_length:
            continue
        sense = 1.0 if (points[i, 0] - origin_x) * y - (points[i, 1] - origin_y) * x < 0.0 else -1.0
        normals[i, 0] = sense * y / length
        normals[i, 1] = -sense * x / length
    return normals


@inner()
def _near(points, i, j, distance):
    return math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1]) <= distance


@inner()
def pseudo_angles(points, origin_x, origin_y):
    """Directions of points from an origin, as :func:`_pseudo_angle` has them, shape (n,)."""
    directions = np.empty(len(points))
    for i in range(len(points)):
        directions[i] = _pseudo_angle(points[i, 0] - origin_x, points[i, 1] - origin_y)
    return directions


@inner()
def beams_on_wall(directions, arm_x, arm_y, normal_x, normal_y, half, c, s):
    """Beams that meet a wall: first, and behind the last, counted on beyond n where they cross the end of the scan.

    Parameters
    ----------
    directions : of the beams, rising, by :func:`pseudo_angles`, shape (n,).
    arm_x, arm_y : from the sensor to the middle of the wall [m].
    normal_x, normal_y : normal of the wall, towards the sensor.
    half : half the length of the wall [m].
    c, s : cosine and sine of the heading from which the beams count, in the frame of the wall.
    """
    # Seen from its front a wall runs counter-clockwise along its normal turned by a quarter to the right.
    along_x, along_y = -half * normal_y, half * normal_x
    x, y = arm_x + along_x, arm_y + along_y
    first = _pseudo_angle(c * x + s * y, c * y - s * x)
    x, y = arm_x - along_x, arm_y - along_y
    last = _pseudo_angle(c * x + s * y, c * y - s * x)
    begin, end = _insertion_index(directions, first, False), _insertion_index(directions, last, True)
    return (begin, end) if first <= last else (begin, end + directions.size)


@inner()
def _pseudo_angle(x, y):
    """Return what grows from -2 to 2 as the direction of a vector does from -pi to pi; an arc tangent takes longer."""
    quarter = y / (abs(x) + abs(y))
    if x >= 0.0:
        return quarter
    return 2.0 - quarter if y > 0.0 else -2.0 - quarter


@inner()
def _insertion_index(directions, direction, after_equal):
    """Where a direction belongs among rising ones; np.searchsorted takes several times as long."""
    place = 0
    left = directions.size
    while left > 0:
        half = left >> 1
        middle = directions[place + half]
        before = (middle < direction) | (after_equal & (middle == direction))
        place = place + half + 1 if before else place
        left = left - half - 1 if before else half
    return place


@kernel(READ_ONLY, READ_ONLY, f8, f8, f8, f8, f8, f8, f8[:, ::1], f8, f8, f8, f8)
def _points_kernel(
    scan_ranges, scan_angles, range_min, range_max, origin_x, origin_y, yaw, sense, walls_robot, distance, beside,
    same_surface, least_length,
):  # fmt: skip
    kept = is_return(scan_ranges, range_min, range_max)
    ranges = scan_ranges[kept]
    bearings = (yaw + sense * scan_angles[kept] + math.pi) % TWO_PI - math.pi
    for i in range(1, ranges.size):
        if bearings[i] < bearings[i - 1]:
            order = np.argsort(bearings, kind="mergesort")
            bearings = bearings[order]
            ranges = ranges[order]
            break
    n = ranges.size
    points = np.empty((n, 2))
    for i in range(n):
        points[i, 0] = origin_x + ranges[i] * math.cos(bearings[i])
        points[i, 1] = origin_y + ranges[i] * math.sin(bearings[i])

    lines = np.full(n, -1)
    directions = pseudo_angles(points, origin_x, origin_y)
    for k in range(len(walls_robot)):
        normal_x = walls_robot[k, NORMAL_X]
        normal_y = walls_robot[k, NORMAL_Y]
        arm_x = walls_robot[k, WALL_X] - origin_x
        arm_y = walls_robot[k, WALL_Y] - origin_y
        begin, end = beams_on_wall(directions, arm_x, arm_y, normal_x, normal_y, 0.5 * walls_robot[k, LENGTH], 1.0, 0.0)
        for m in range(begin, end):
            i = m if m < n else m - n
            residual = normal_x * (points[i, 0] - origin_x - arm_x) + normal_y * (points[i, 1] - origin_y - arm_y)
            if abs(residual) <= distance:
                lines[i] = k
    normals = _normals(points, lines, walls_robot, origin_x, origin_y, beside, same_surface, least_length)
    return points, ranges, bearings, lines, normals
