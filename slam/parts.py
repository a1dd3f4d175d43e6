"""Builds the parts of the pipeline from the configuration, converted to SI units."""

import math
import sys
from dataclasses import dataclass

import numpy as np

from features.config import ExtractionConfig
from features.extraction import extract
from features.feature import Features
from features.scan import LaserScan
from features.se2 import Pose
from features.sensor import SensorModel
from slam.config import SlamConfig
from slam.filter.association import Associator, Gates
from slam.filter.front_end import FrontEnd
from slam.loop.closer import LoopCloser
from slam.odometry.cloned_pose import PoseClone
from slam.odometry.line_odometry import LineOdometry
from slam.odometry.motion_models import ConstantVelocity, OdometryModel, WheelMotion, WheelSpeeds
from slam.rules import SlamRules
from slam.trust.monitor import TrustMonitor

FIRST_POSE_COV = np.diag([1e-8, 1e-8, 1e-10])
"""Covariance of the first pose, almost zero, as this pose defines the world frame [m^2, m^2, rad^2]."""


@dataclass(frozen=True, slots=True)
class CwlfExtractor:
    """The extractor that comes with the project, with its rules.

    Parameters
    ----------
    rules : for segments, lines and corners.
    """

    rules: ExtractionConfig

    def __call__(self, scan: LaserScan, sensor: SensorModel) -> Features:
        """See :func:`features.extraction.extract`."""
        return extract(scan, sensor, self.rules)

    def of_whole_walls(self) -> "CwlfExtractor":
        """Return the extractor that takes no wall apart for what is less than its other rules see.

        The straightness of a wall is tested with the noise; to measure the noise takes walls as rough as they are.
        """
        return CwlfExtractor(self.rules.model_copy(update={"straight_level": sys.float_info.min}))


@dataclass(frozen=True, slots=True, eq=False)
class Estimators:
    """The estimators of motion and landmarks, created at the first pose.

    Parameters
    ----------
    odometry : pose by wheels and scans, without landmarks.
    front_end : the filter.
    since_update : motion since the filter was moved last.
    since_key_frame : motion since the newest key frame.
    since_scan : motion since the last scan.
    """

    odometry: LineOdometry
    front_end: FrontEnd
    since_update: PoseClone
    since_key_frame: PoseClone
    since_scan: PoseClone

    @classmethod
    def start(
        cls,
        config: SlamConfig,
        rules: SlamRules,
        pose_world_robot: Pose,
        associator: Associator | None,
        sensor: SensorModel,
    ) -> "Estimators":
        """Estimators as they are configured, at the first pose, shape (3,), for a sensor that may be measured."""
        odometry = line_odometry(config, pose_world_robot, rules, sensor)
        keep_distance = config.front_end.keep_distance_m
        front_end = FrontEnd(
            pose_world_robot, FIRST_POSE_COV, gates(config, rules), keep_distance, associator, rules.filter
        )
        return cls(odometry, front_end, odometry.clone(), odometry.clone(), odometry.clone())


def line_odometry(
    config: SlamConfig,
    pose_map_robot: Pose,
    rules: SlamRules = SlamRules(),  # noqa: B008, frozen
    sensor: SensorModel | None = None,
) -> LineOdometry:
    """Odometry as it is configured, from its first pose; the sensor is that of the configuration by default."""
    odometry = config.odometry
    wheels = OdometryModel(
        position_per_travel=odometry.position_per_travel,
        position_per_turn=odometry.position_per_turn,
        heading_per_travel=math.radians(odometry.heading_per_travel_deg),
        heading_per_turn=math.radians(odometry.heading_per_turn_deg),
    )
    if odometry.source == "lines":
        motion = ConstantVelocity(
            speed=odometry.speed_m_s,
            turn_rate=math.radians(odometry.turn_rate_deg_s),
            speed_change=odometry.speed_change_m_s,
            turn_rate_change=math.radians(odometry.turn_rate_change_deg_s),
            rules=rules.velocity,
        )
    else:
        speeds = WheelSpeeds(odometry.speed_m_s, math.radians(odometry.turn_rate_deg_s), rules.velocity)
        motion = WheelMotion(wheels, speeds, rules.wheels)
    extraction = config.extraction
    sensor = sensor or config.sensor.model()
    line_distance = max(extraction.split_distance_mm * 1e-3, extraction.split_sigmas * sensor.sigma_range)
    return LineOdometry(pose_map_robot, motion, sensor, line_distance, odometry.key_frames, rules.odometry)


def gates(config: SlamConfig, rules: SlamRules) -> Gates:
    """Gates of the association in the units it works in."""
    front_end = config.front_end
    return Gates(
        method=front_end.association,
        match_probability=front_end.match_probability,
        birth_probability=front_end.birth_probability,
        birth_distance=front_end.birth_distance_m,
        opening=math.radians(front_end.opening_tolerance_deg),
        orientation=math.radians(front_end.orientation_tolerance_deg),
        most_nodes=rules.filter.most_nodes,
    )


def loop_closer(config: SlamConfig, rules: SlamRules) -> LoopCloser:
    """Loop closing as it is configured, without key frames."""
    loop = config.loop
    return LoopCloser(apart=loop.apart_m, reach=loop.reach_m, share=loop.least_share, rules=rules.loop)


def trust_monitor(config: SlamConfig, rules: SlamRules) -> TrustMonitor:
    """Watch over a run as it is configured."""
    wheels = config.odometry.source == "line-aided"
    return TrustMonitor(config.front_end.match_probability, rules.odometry.sure_share, wheels=wheels, rules=rules.trust)
