# pyright: standard
"""Which points and walls the beams of a scan have gone through, and which walls they end on."""

import math

import numpy as np
from numba import f8, i8
from numpy.typing import NDArray

from features.compiled import READ_ONLY, kernel
from features.returns import is_return
from features.scan import LaserScan
from features.se2 import TWO_PI, Array, Pose
from features.sensor import SensorModel
from slam.odometry.line_map import LENGTH, NORMAL_X, NORMAL_Y, WALL_X, WALL_Y
from slam.odometry.rules import BeamRules
from slam.odometry.scan_points import ScanPoints, beams_on_wall, pseudo_angles

HIDDEN, IN_SIGHT, PASSED = range(3)
"""What the beams next to a point show of its place: nothing, a surface there, or that there is none."""

UNKNOWN, ON, BEFORE, THROUGH = range(4)
"""Where a beam ends."""


def look_at(
    scan: LaserScan,
    sensor: SensorModel,
    points_robot: Array,
    rules: BeamRules = BeamRules(),  # noqa: B008, frozen
) -> NDArray[np.int64]:
    """Return what a scan shows of the places of points, shape (n,).

    :data:`PASSED` where every beam next to a point ends well behind it, so that nothing is there; :data:`IN_SIGHT`
    where at least half of them end near it; else :data:`HIDDEN`.

    Parameters
    ----------
    scan : sensor frame.
    sensor : its limits and mounting.
    points_robot : robot frame, shape (n, 2) [m].
    rules : which beams are next to a point, how far behind it they have to end, and within half of that, near it.
    """
    if not len(scan):
        return np.full(len(points_robot), HIDDEN)
    points_sensor = sensor.mounting.points_to_sensor(points_robot)
    return _look_at(
        scan.ranges, scan.angles, sensor.range_min, sensor.range_max, points_sensor, rules.behind, rules.beside
    )


@kernel(READ_ONLY, READ_ONLY, f8, f8, f8[:, ::1], f8, i8)
def _look_at(ranges, angles, range_min, range_max, points, behind, each_side):
    angles = angles % TWO_PI
    order = np.argsort(angles, kind="mergesort")
    angles = angles[order]
    shown = np.full(len(points), HIDDEN)
    for k in range(len(points)):
        distance = math.hypot(points[k, 0], points[k, 1])
        bearing = math.atan2(points[k, 1], points[k, 0]) % TWO_PI
        at = np.searchsorted(angles, bearing)
        passed = near = 0
        for beside in range(at - each_side, at + each_side):
            beam = beside % angles.size
            reach = ranges[order[beam]]
            # A gap in the scan, such as behind a sensor that does not look all round, shows nothing.
            off = distance * abs((angles[beam] - bearing + math.pi) % TWO_PI - math.pi)
            if is_return(reach, range_min, range_max) and off < behind:
                passed += reach > distance + behind
                near += abs(reach - distance) <= 0.5 * behind
        if passed == 2 * each_side:
            shown[k] = PASSED
        elif near >= each_side:
            shown[k] = IN_SIGHT
    return shown


def beams_through_walls(
    scan: ScanPoints,
    walls: Array,
    pose_map_robot: Pose,
    rules: BeamRules = BeamRules(),  # noqa: B008, frozen
) -> int:
    """Count the beams of a scan that, from a pose, would have gone through a wall; see :func:`judge_beams`."""
    return int((judge_beams(scan, walls, pose_map_robot, rules) == THROUGH).sum())


def judge_beams(
    scan: ScanPoints,
    walls: Array,
    pose_map_robot: Pose,
    rules: BeamRules = BeamRules(),  # noqa: B008, frozen
) -> NDArray[np.int64]:
    """Judge where, from a pose, each beam of a scan ends: ON a wall, or well BEFORE one or THROUGH it, shape (n,).

    A beam that meets no wall is UNKNOWN. One that ends before a wall says less against the pose than one that goes
    through: something new may stand there.

    Parameters
    ----------
    scan : points, robot frame.
    walls : that were seen before, map frame, shape (m, WALL_FIELDS).
    pose_map_robot : shape (3,).
    rules : how far behind a wall a beam has to end.
    """
    mounting = scan.sensor.mounting
    return _judge_beams(scan.points, mounting.x, mounting.y, walls, pose_map_robot, rules.behind)


@kernel(f8[:, ::1], f8, f8, f8[:, ::1], f8[::1], f8)
def _judge_beams(points, origin_x, origin_y, walls, pose, behind):
    n = len(points)
    directions = pseudo_angles(points, origin_x, origin_y)
    c = math.cos(pose[2])
    s = math.sin(pose[2])
    sensor_x = c * origin_x - s * origin_y
    sensor_y = s * origin_x + c * origin_y
    on = np.zeros(n, np.bool_)
    beyond = np.zeros(n, np.bool_)
    judged = np.full(n, UNKNOWN)
    for wall in walls:
        base_x = wall[WALL_X] - pose[0]
        base_y = wall[WALL_Y] - pose[1]
        arm_x = base_x - sensor_x
        arm_y = base_y - sensor_y
        if wall[NORMAL_X] * arm_x + wall[NORMAL_Y] * arm_y >= 0.0:
            continue
        begin, end = beams_on_wall(directions, arm_x, arm_y, wall[NORMAL_X], wall[NORMAL_Y], 0.5 * wall[LENGTH], c, s)
        for m in range(begin, end):
            i = m if m < n else m - n
            x = c * points[i, 0] - s * points[i, 1] - base_x
            y = s * points[i, 0] + c * points[i, 1] - base_y
            before = wall[NORMAL_X] * x + wall[NORMAL_Y] * y
            on[i] |= abs(before) < 0.5 * behind
            beyond[i] |= before < -behind
            if before > behind:
                judged[i] = BEFORE
    judged[beyond] = THROUGH
    judged[on] = ON
    return judged
