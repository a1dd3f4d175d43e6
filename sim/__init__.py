"""Simulation: worlds, ray casting, lidar noise and robot motion; a run is one more source of frames, with its truth."""

from sim.errors import WorldError
from sim.lidar import Lidar
from sim.odometry import WheelOdometry
from sim.raycast import cast
from sim.robot import Robot, Trajectory
from sim.run import POOR_ODOMETRY, SimulatedRun, room_run
from sim.world import World
from sim.worlds import room, room_waypoints

__all__ = [
    "POOR_ODOMETRY",
    "Lidar",
    "Robot",
    "SimulatedRun",
    "Trajectory",
    "WheelOdometry",
    "World",
    "WorldError",
    "cast",
    "room",
    "room_run",
    "room_waypoints",
]
