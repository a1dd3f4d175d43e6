"""Simulation: worlds, ray casting, lidar noise and robot motion; a run is one more source of frames, with its truth."""

from sim.errors import WorldError
from sim.motion.alpha_odometry import AlphaOdometry
from sim.motion.drive import drive_through
from sim.motion.odometry import WheelOdometry
from sim.motion.people import people_beside
from sim.motion.person import Person
from sim.motion.robot import OmniRobot, Robot, Trajectory
from sim.run import ODOMETRIES, POOR_ODOMETRY, SimulatedRun, room_run
from sim.sensing.effects import EFFECTS, Effects
from sim.sensing.labels import label_corners
from sim.sensing.lidar import Lidar, Measurement
from sim.sensing.visibility import VisibleSections, visible_corners, visible_sections
from sim.site_run import site_run
from sim.worlds.built_in.paper import ENVIRONMENT_A_POSE, ENVIRONMENT_B_POSE, environment_a, environment_b
from sim.worlds.built_in.random_rooms import random_pose, random_room, random_tour
from sim.worlds.built_in.room import room, room_waypoints
from sim.worlds.check import findings
from sim.worlds.formats.read import read_site
from sim.worlds.site import Site
from sim.worlds.sites import BUILT_IN, find_site
from sim.worlds.world import World

__all__ = [
    "BUILT_IN",
    "EFFECTS",
    "ENVIRONMENT_A_POSE",
    "ENVIRONMENT_B_POSE",
    "ODOMETRIES",
    "POOR_ODOMETRY",
    "AlphaOdometry",
    "Effects",
    "Lidar",
    "Measurement",
    "OmniRobot",
    "Person",
    "Robot",
    "SimulatedRun",
    "Site",
    "Trajectory",
    "VisibleSections",
    "WheelOdometry",
    "World",
    "WorldError",
    "drive_through",
    "environment_a",
    "environment_b",
    "find_site",
    "findings",
    "label_corners",
    "people_beside",
    "random_pose",
    "random_room",
    "random_tour",
    "read_site",
    "room",
    "room_run",
    "room_waypoints",
    "site_run",
    "visible_corners",
    "visible_sections",
]
