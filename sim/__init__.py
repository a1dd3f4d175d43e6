"""The simulator: a robot drives through a world, and its lidar and wheels measure what they would measure there.

A simulated run is a source of frames like a log or a sensor, with the truth beside it. The rooms are, from the bottom
up: casting (exact ranges to walls), worlds, motion (of robots and people, and odometry), sensing (what a lidar
measures), and the emulator of a scanner on a serial line. The simulator may import features and drivers; it shares no
motion or measurement code with the estimator in ``slam``, so that an error in one of them cannot hide in the other.
"""

import warnings
from typing import Any

from sim.errors import WorldError
from sim.motion.alpha_odometry import AlphaOdometry
from sim.motion.drive import drive_through
from sim.motion.odometry import WheelOdometry
from sim.motion.odometry_presets import ODOMETRIES, POOR_ODOMETRY
from sim.motion.people import people_beside
from sim.motion.person import Person
from sim.motion.robot import OmniRobot, Robot
from sim.motion.true_trajectory import TrueTrajectory
from sim.scenarios import room_run, site_run
from sim.sensing.effects import EFFECTS, Effects, effects_of
from sim.sensing.labels import label_corners
from sim.sensing.lidar import Lidar, Measurement
from sim.sensing.visibility import VisibleSections, visible_corners, visible_sections
from sim.simulated_run import SimulatedRun
from sim.worlds.built_in.cluttered_rooms import cluttered_room
from sim.worlds.built_in.demo_room import room, room_waypoints
from sim.worlds.built_in.paper import ENVIRONMENT_A_POSE, ENVIRONMENT_B_POSE, environment_a, environment_b
from sim.worlds.built_in.random_rooms import random_pose, random_room, random_tour
from sim.worlds.catalogue import BUILT_IN, find_site
from sim.worlds.check import findings
from sim.worlds.formats.world_file import read_site
from sim.worlds.site import Site
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
    "TrueTrajectory",
    "VisibleSections",
    "WheelOdometry",
    "World",
    "WorldError",
    "cluttered_room",
    "drive_through",
    "effects_of",
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


def __getattr__(name: str) -> Any:
    if name == "Trajectory":
        warnings.warn("sim.Trajectory is now sim.TrueTrajectory", DeprecationWarning, stacklevel=2)
        return TrueTrajectory
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
