"""Drives through a world that keep a robot clear of the walls."""

import itertools

import numpy as np
import numpy.typing as npt
import shapely

from features.se2 import Array
from sim.errors import WorldError
from sim.motion.robot import Robot
from sim.motion.true_trajectory import TrueTrajectory
from sim.worlds.check import segments
from sim.worlds.world import World

ROBOT_RADIUS = 0.15
"""Radius of the robot: nearer to a wall, it touches the wall [m]. It is that of a small indoor robot, such as a
TurtleBot."""


def drive_through(world: World, waypoints: npt.ArrayLike, robot: Robot, rate: float) -> TrueTrajectory:
    """Drive a robot through all waypoints, clear of every wall.

    Parameters
    ----------
    world : the walls.
    waypoints : path, world frame, shape (n, 2), n >= 2 [m].
    robot : limits of the motion.
    rate : poses per second [Hz].

    Raises
    ------
    WorldError
        The path has too few waypoints or two that are too near to each other, leaves the world, or goes through a wall;
        or the robot starts in a wall or touches one.
    """
    points = np.asarray(waypoints, dtype=np.float64)
    where = f"world {world.name!r}"
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise WorldError(f"{where}: the path has shape {points.shape}: expected finite waypoints of shape (n, 2)")
    ends = world.walls.reshape(-1, 2, 2)
    low, high = ends.min(axis=(0, 1)), ends.max(axis=(0, 1))
    for k, point in enumerate(points):
        if not ((point >= low) & (point <= high)).all():
            raise WorldError(
                f"{where}: waypoint {k} at {_at(point)} is outside: the walls reach from {_at(low)} to {_at(high)}"
            )
    lines = segments(ends)
    tree = shapely.STRtree(lines)
    for start, end in itertools.pairwise(points):
        leg = shapely.LineString([start, end])
        hit = tree.query(leg, predicate="intersects")
        if len(hit):
            places = shapely.intersection(lines[hit], leg)
            distances = shapely.distance(places, shapely.Point(start))  # pyright: ignore[reportUnknownMemberType]  # its keyword arguments are untyped
            wall = int(hit[np.argmin(distances)])
            raise WorldError(f"{where}: the path from {_at(start)} to {_at(end)} goes through {_wall(world, wall)}")
    try:
        trajectory = robot.drive(points, rate)
    except ValueError as error:
        raise WorldError(f"{where}: the path: {error}") from None
    positions = trajectory.poses_world_robot[:, :2]
    touching, walls = tree.query(shapely.points(positions), predicate="dwithin", distance=ROBOT_RADIUS)
    if len(touching):
        first, wall = int(touching.min()), _wall(world, int(walls[touching.argmin()]))
        if first == 0:
            raise WorldError(f"{where}: the robot starts at {_at(positions[0])}, in {wall}")
        raise WorldError(
            f"{where}: the robot touches {wall} at {_at(positions[first])}: "
            f"expected waypoints that keep it {ROBOT_RADIUS:g} m clear, also where it turns"
        )
    return trajectory


def _at(point: Array) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _wall(world: World, index: int) -> str:
    return f"wall {index} from {_at(world.walls[index, :2])} to {_at(world.walls[index, 2:])}"
