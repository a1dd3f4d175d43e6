"""Scenarios: simulated runs of a robot through the demo's room and through any world."""

import numpy as np

from features.se2 import Array
from features.sensor import Mounting
from sim.errors import WorldError
from sim.motion.drive import drive_through
from sim.motion.odometry import Odometry
from sim.motion.odometry_presets import POOR_ODOMETRY
from sim.motion.people import people_beside
from sim.motion.robot import Robot
from sim.sensing.effects import Effects
from sim.sensing.lidar import Lidar
from sim.simulated_run import SimulatedRun
from sim.worlds.built_in.demo_room import room, room_waypoints
from sim.worlds.check import open_ends
from sim.worlds.site import Site

ODOMETRY_RATE = 50.0
"""Odometry records per second, as is usual for wheel encoders [Hz]; :func:`site_run` rounds it to a whole multiple of
the rate of the lidar."""


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
    """Make a run of a robot through a world, clear of its walls.

    Parameters
    ----------
    site : the walls, and the path unless ``waypoints`` are given.
    lidar : the scanner and its mounting.
    sensor : name of the sensor preset that fits the lidar.
    seed : seed of all randomness of the run.
    waypoints : path, world frame, shape (n, 2), n >= 2 [m]; by default that of the site.
    odometry : model of the odometry.
    people : number of people, placed by :func:`sim.motion.people.people_beside`.
    may_be_open : whether the outlines of the walls may have open ends.

    Raises
    ------
    WorldError
        A wall is unusable, an outline is not closed, there is no path, the robot cannot drive along it, or there is
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
    # The run itself spawns the children 0 and 1 of the same seed.
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


def room_run(
    seed: int,
    preset: str = "rplidar-s1",
    mounting: Mounting | None = None,
    effects: Effects = Effects(),  # noqa: B008, frozen
) -> SimulatedRun:
    """Make the run of the demo: two rounds through its room with poor odometry, which drifts by metres in all.

    Parameters
    ----------
    seed : seed of all randomness of the run.
    preset : sensor preset: ``rplidar-s1`` or ``sick-lms``.
    mounting : pose of the sensor on the robot; by default at its origin, facing forward.
    effects : errors of the sensor beside the noise of the paper; by default none.

    Raises
    ------
    ValueError
        No sensor preset has this name.
    """
    return SimulatedRun(
        name=f"room-{seed}",
        world=room(),
        lidar=Lidar.of_preset(preset, mounting, effects),
        sensor=preset,
        trajectory=Robot().drive(room_waypoints(), ODOMETRY_RATE),
        odometry=POOR_ODOMETRY,
        seed=seed,
    )
