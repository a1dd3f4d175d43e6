"""A simulated run through any world."""

import numpy as np

from features.se2 import Array
from sim.errors import WorldError
from sim.motion.drive import drive_through
from sim.motion.odometry import Odometry
from sim.motion.people import people_beside
from sim.motion.robot import Robot
from sim.run import POOR_ODOMETRY, SimulatedRun
from sim.sensing.lidar import Lidar
from sim.worlds.check import open_ends
from sim.worlds.site import Site

ODOMETRY_RATE = 50.0
"""Odometry records per second, or the next whole multiple of the lidar's rate [Hz]."""


def site_run(
    site: Site,
    lidar: Lidar,
    sensor: str,
    seed: int,
    waypoints: Array | None = None,
    *,
    odometry: Odometry = POOR_ODOMETRY,
    people: int = 0,
    may_be_open: bool = False,
) -> SimulatedRun:
    """Drive a robot through a world, clear of its walls.

    Parameters
    ----------
    site : the world, and the path where none is given.
    lidar : the scanner and its mounting.
    sensor : name of the sensor preset that fits the lidar.
    seed : of all randomness of the run.
    waypoints : path, world frame, shape (n, 2), n >= 2 [m].
    odometry : errors of the wheels.
    people : how many are about, see :func:`sim.motion.people.people_beside`.
    may_be_open : whether outlines may have open ends.

    Raises
    ------
    WorldError
        A wall is unusable, an outline is not closed, there is no path, the robot does not get along it, or there is
        no room for people.
    """
    world = site.world()
    found = [] if may_be_open else open_ends(site.walls)
    if found:
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        raise WorldError(
            f"world {site.name!r} is open: {found[0]}{more}: `cwlf-slam world check` lists what is wrong, "
            "--open drives in it anyway"
        )
    path = site.waypoints if waypoints is None else waypoints
    if path is None:
        raise WorldError(f"world {site.name!r} has no path: give one with --path")
    rate = lidar.rate * max(1, round(ODOMETRY_RATE / lidar.rate))
    trajectory = drive_through(world, path, Robot(), rate)
    # Not one of the two that the run makes of its seed for itself.
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    return SimulatedRun(
        name=site.name,
        world=world,
        lidar=lidar,
        sensor=sensor,
        trajectory=trajectory,
        odometry=odometry,
        seed=seed,
        people=people_beside(world, trajectory.poses_world_robot, people, rng),
    )
