"""Registration of a scan, point to line, to walls that were seen before."""

import math
from dataclasses import dataclass

from features.se2 import Array, Pose, wrap_angle
from slam.odometry.registration_kernel import register_kernel
from slam.odometry.rules import RegistrationRules
from slam.odometry.scan_points import ScanPoints


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """Result of a registration, with the information of the scan alone in canonical form.

    Parameters
    ----------
    pose_map_robot : where prior and scan together put the robot, shape (3,) [m, m, rad].
    information : of the pose, from the scan alone, shape (3, 3).
    pull : information times the difference between the scan's pose and the prior (information vector), shape (3,).
    share : of the points of the scan those that lie on a wall, 0 to 1.
    """

    pose_map_robot: Pose
    information: Array
    pull: Array
    share: float


def register(
    scan: ScanPoints, walls: Array, prior: Pose, prior_cov: Array, start: Pose, rules: RegistrationRules
) -> Registration:
    """Fit the points of a scan to walls, given where the robot should be (eq. M27-M31).

    Parameters
    ----------
    scan : points, robot frame.
    walls : map frame, shape (m, WALL_FIELDS).
    prior, prior_cov : pose that is expected, map frame, shape (3,), and its covariance, shape (3, 3); may be singular.
    start : pose from which the iterations start, shape (3,).
    rules : gates and limits.
    """
    sensor = scan.sensor
    pose, information, pull, inliers = register_kernel(
        scan.points, scan.ranges, scan.lines, scan.normals, scan.walls_robot,
        sensor.mounting.x, sensor.mounting.y, sensor.sigma_range**2, sensor.sigma_bearing**2,
        walls, prior, prior_cov, start, rules.gate, rules.final_gate, rules.narrowing, rules.gate_sigmas**2,
        rules.reach, rules.nearest, rules.scatter**2, rules.roughness**2, rules.kernel**2, rules.inlier**2,
        math.cos(rules.turn), math.cos(rules.surface_turn), rules.crookedness**2, rules.step**2, rules.max_iterations,
    )  # fmt: skip
    pose[2] = wrap_angle(float(pose[2]))
    return Registration(pose, information, pull, inliers / max(len(scan), 1))
