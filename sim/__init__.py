"""Simulation: worlds, ray casting, lidar noise and robot motion; a run is one more source of frames, with its truth."""

from sim.alpha_odometry import AlphaOdometry
from sim.effects import EFFECTS, Effects
from sim.errors import WorldError
from sim.labels import label_corners
from sim.lidar import Lidar, Measurement
from sim.odometry import WheelOdometry
from sim.paper_worlds import ENVIRONMENT_A_POSE, ENVIRONMENT_B_POSE, environment_a, environment_b
from sim.person import Person
from sim.random_rooms import random_pose, random_room
from sim.robot import OmniRobot, Robot, Trajectory
from sim.run import POOR_ODOMETRY, SimulatedRun, room_run
from sim.visibility import VisibleSections, visible_corners, visible_sections
from sim.world import World
from sim.worlds import room, room_waypoints

__all__ = [
    "EFFECTS",
    "ENVIRONMENT_A_POSE",
    "ENVIRONMENT_B_POSE",
    "POOR_ODOMETRY",
    "AlphaOdometry",
    "Effects",
    "Lidar",
    "Measurement",
    "OmniRobot",
    "Person",
    "Robot",
    "SimulatedRun",
    "Trajectory",
    "VisibleSections",
    "WheelOdometry",
    "World",
    "WorldError",
    "environment_a",
    "environment_b",
    "label_corners",
    "random_pose",
    "random_room",
    "room",
    "room_run",
    "room_waypoints",
    "visible_corners",
    "visible_sections",
]
