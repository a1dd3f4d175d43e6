"""A simulated run through any world."""

from features.se2 import Array
from sim.check import open_ends
from sim.drive import drive_through
from sim.errors import WorldError
from sim.lidar import Lidar
from sim.robot import Robot
from sim.run import POOR_ODOMETRY, SimulatedRun
from sim.site import Site

ODOMETRY_RATE = 50.0
"""Odometry records per second, or the next whole multiple of the lidar's rate [Hz]."""


def site_run(
    site: Site, lidar: Lidar, sensor: str, seed: int, waypoints: Array | None = None, *, may_be_open: bool = False
) -> SimulatedRun:
    """Drive a robot with poor odometry through a world, clear of its walls.

    Parameters
    ----------
    site : the world, and the path where none is given.
    lidar : the scanner and its mounting.
    sensor : name of the sensor preset that fits the lidar.
    seed : of all randomness of the run.
    waypoints : path, world frame, shape (n, 2), n >= 2 [m].
    may_be_open : whether outlines may have open ends.

    Raises
    ------
    WorldError
        A wall is unusable, an outline is not closed, there is no path, or the robot does not get along it.
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
    return SimulatedRun(
        name=site.name,
        world=world,
        lidar=lidar,
        sensor=sensor,
        trajectory=drive_through(world, path, Robot(), rate),
        odometry=POOR_ODOMETRY,
        seed=seed,
    )
