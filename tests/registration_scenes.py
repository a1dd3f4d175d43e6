"""Walls, scans of them and robots that drive among them, for the tests of registration and odometry."""

import math

import numpy as np

from features.extraction import extract
from features.scan import LaserScan
from features.sensor import SensorModel
from sim import SimulatedRun
from sim.motion.odometry import WheelOdometry
from sim.motion.robot import Robot
from sim.sensing.lidar import Lidar
from sim.worlds.world import World
from slam.config import SlamConfig
from slam.odometry.line_map import LineMap, walls_of_lines
from slam.odometry.scan_points import ScanPoints, scan_points

LIDAR = Lidar.of_preset("rplidar-s1", None)
CONFIG = SlamConfig.of_preset("rplidar-s1")
SENSOR = CONFIG.sensor.model()
LINE_DISTANCE = 0.1

CORRIDOR = World("corridor", np.array([[-100.0, 1.0, 200.0, 1.0], [200.0, -1.1, -100.0, -1.1]]))
"""Two bare walls, longer than the range of the sensor."""

WHEELS = WheelOdometry(
    sigma_turn_per_radian=math.radians(6.0),
    sigma_turn_per_metre=math.radians(3.0),
    sigma_distance_per_metre=0.05,
    sigma_distance_per_radian=0.03,
)
"""Wheels that err as the default configuration says, though not sideways."""


def seen(world: World, pose_world_robot, rng, sensor: SensorModel = SENSOR) -> ScanPoints:
    """What a scan of the world shows from a pose."""
    scan = LIDAR.scan(world, pose_world_robot, 0.0, rng)
    return points_of(scan, sensor)


def points_of(scan: LaserScan, sensor: SensorModel = SENSOR) -> ScanPoints:
    lines = extract(scan, sensor, CONFIG.extraction).lines
    return scan_points(scan, walls_of_lines(lines, sensor.mounting), sensor, LINE_DISTANCE)


def map_of(world: World, poses, rng) -> np.ndarray:
    """Walls of a line map of key frames at true poses."""
    line_map = LineMap(len(poses))
    for each in poses:
        line_map.add(seen(world, each, rng).walls_robot, each)
    return line_map.walls


def corridor_run(seed: int) -> SimulatedRun:
    """Along the corridor and back, turning on the spot at its end."""
    drive = Robot().drive([(0.0, 0.0), (8.0, 0.2), (0.0, -0.2)], 50.0)
    return SimulatedRun("corridor", CORRIDOR, LIDAR, "rplidar-s1", drive, WHEELS, seed)
