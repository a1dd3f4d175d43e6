"""Registration of a scan, point to line, to walls that were seen before."""

import math
from dataclasses import dataclass

from features.se2 import Array, Pose, wrap_angle
from slam.odometry.registration_kernel import register_kernel
from slam.odometry.scan_points import ScanPoints


@dataclass(frozen=True, slots=True)
class RegistrationRules:
    """What a registration takes for the same wall and when it ends.

    Parameters
    ----------
    gate, final_gate : distance up to which a point may belong to a wall, at first and at last [m].
    reach : how far beyond its ends a wall may go on [m].
    scatter : how far apart the same wall lies as seen from different key frames [m].
    roughness : how far the points of a real wall lie off a straight line, beyond the noise of the sensor [m].
    crookedness : how far the directions of walls err, beyond the noise of the sensor [rad].
    kernel : residual, in sigmas, where the Cauchy kernel halves the weight of a point.
    turn : largest angle between a wall and the same wall as a line of the scan [rad].
    step : change of the pose, in sigmas of the scan, with which the iterations end.
    max_iterations : limit of the iterations.
    """

    gate: float = 0.5
    final_gate: float = 0.15
    reach: float = 0.2
    scatter: float = 0.02
    roughness: float = 0.005
    crookedness: float = math.radians(1.0)
    kernel: float = 2.0
    turn: float = math.radians(30.0)
    step: float = 0.1
    max_iterations: int = 12


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """Where a scan fits, and what it says of the pose.

    Parameters
    ----------
    pose_map_robot : where prior and scan together put the robot, shape (3,) [m, m, rad].
    information : of the pose, from the scan alone, shape (3, 3).
    pull : what the information tells of the difference between the scan's pose and the prior's, shape (3,).
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
        walls, prior, prior_cov, start, rules.gate, rules.final_gate, rules.reach, rules.scatter**2, rules.roughness**2,
        rules.kernel**2, math.cos(rules.turn), rules.crookedness**2, rules.step**2, rules.max_iterations,
    )  # fmt: skip
    pose[2] = wrap_angle(float(pose[2]))
    return Registration(pose, information, pull, inliers / max(len(scan), 1))
