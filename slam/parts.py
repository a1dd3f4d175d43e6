"""Parts of the pipeline, made of the numbers of the configuration."""

import math

from features.se2 import Pose
from slam.config import SlamConfig
from slam.filter.association import Gates
from slam.loop.rules import LoopRules
from slam.odometry.line_odometry import LineOdometry
from slam.odometry.motion_models import ConstantVelocity, OdometryModel, WheelMotion


def line_odometry(config: SlamConfig, pose_map_robot: Pose) -> LineOdometry:
    """Odometry as it is configured, from its first pose."""
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
        )
    else:
        motion = WheelMotion(wheels)
    rules = config.extraction
    sensor = config.sensor.model()
    line_distance = max(rules.split_distance_mm * 1e-3, rules.split_sigmas * sensor.sigma_range)
    return LineOdometry(pose_map_robot, motion, sensor, line_distance, odometry.key_frames)


def gates(config: SlamConfig) -> Gates:
    """Gates of the association in the units it works in."""
    front_end = config.front_end
    return Gates(
        method=front_end.association,
        match_probability=front_end.match_probability,
        birth_probability=front_end.birth_probability,
        birth_distance=front_end.birth_distance_m,
        opening=math.radians(front_end.opening_tolerance_deg),
        orientation=math.radians(front_end.orientation_tolerance_deg),
    )


def loop_rules(config: SlamConfig) -> LoopRules:
    """Return what counts as the same place."""
    loop = config.loop
    return LoopRules(apart=loop.apart_m, reach=loop.reach_m, share=loop.least_share)
