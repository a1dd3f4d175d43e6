"""People beside the way of a robot."""

import numpy as np
import shapely

from features.se2 import Array
from sim.errors import WorldError
from sim.motion.drive import ROBOT_RADIUS
from sim.motion.person import Person
from sim.worlds.check import segments
from sim.worlds.world import World

RADIUS = 0.25
"""Of a person [m]."""

_ASIDE, _LENGTHS, _SPEEDS = (0.4, 1.5), (1.0, 10.0), (0.4, 1.4)
"""How far beside the way of the robot a person goes, on a stretch of which length [m], and how fast [m/s]."""

_ATTEMPTS = 500
"""Stretches that are tried for each person."""


def people_beside(world: World, poses_world_robot: Array, count: int, rng: np.random.Generator) -> tuple[Person, ...]:
    """Let people go to and fro beside the way of a robot, each on a straight stretch clear of walls and of the robot.

    Parameters
    ----------
    world : the walls.
    poses_world_robot : way of the robot, shape (n, 3), n >= 2 [m, m, rad].
    count : number of people.
    rng : chooses stretches and speeds.

    Raises
    ------
    WorldError
        There is no room for them.
    """
    if count == 0:
        return ()
    walls = shapely.union_all(segments(world.walls.reshape(-1, 2, 2)))
    way = shapely.LineString(poses_world_robot[:, :2]).simplify(0.01)
    taken = walls.buffer(RADIUS).union(way.buffer(RADIUS + ROBOT_RADIUS))
    return tuple(_person(world.name, poses_world_robot, walls, taken, rng) for _ in range(count))


def _person(
    name: str, poses_world_robot: Array, walls: shapely.Geometry, taken: shapely.Geometry, rng: np.random.Generator
) -> Person:
    for _ in range(_ATTEMPTS):
        x, y, heading = poses_world_robot[rng.integers(len(poses_world_robot))]
        aside = rng.choice([-1.0, 1.0]) * rng.uniform(*_ASIDE)
        along = np.array([np.cos(heading), np.sin(heading)])
        start = np.array([x, y]) + aside * np.array([-along[1], along[0]])
        if shapely.intersects(walls, shapely.LineString([(x, y), start])):
            continue
        free = shapely.get_parts(shapely.LineString([start, start + rng.uniform(*_LENGTHS) * along]).difference(taken))
        longest = max(free, key=lambda part: part.length, default=None)
        if (
            longest is not None
            and longest.length >= _LENGTHS[0]
            and not shapely.intersects(walls, shapely.LineString([start, longest.coords[0]]))
        ):
            return Person(np.array(longest.coords), rng.uniform(*_SPEEDS), RADIUS)
    raise WorldError(f"world {name!r}: there is no room for a person beside the way of the robot")
