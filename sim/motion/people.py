"""People who walk beside the path of a robot."""

import numpy as np
import shapely

from features.se2 import Array
from sim.errors import WorldError
from sim.motion.drive import ROBOT_RADIUS
from sim.motion.person import Person
from sim.worlds.check import segments
from sim.worlds.world import World

RADIUS = 0.25
"""Radius of a person [m]: half the width of the shoulders of an adult."""

_ASIDE = (0.4, 1.5)
"""Least and largest distance of a person from the path of the robot [m]: from 0.4 m on, :data:`RADIUS` and
:data:`sim.motion.drive.ROBOT_RADIUS` leave them apart, and up to 1.5 m there is room in a corridor."""

_LENGTHS = (1.0, 10.0)
"""Least and largest length of the stretch on which a person goes to and fro [m]: within a room or a corridor."""

_SPEEDS = (0.4, 1.4)
"""Least and largest speed of a person [m/s]: from strolling to normal walking."""

_ATTEMPTS = 500
"""Stretches that are tried for each person before the world counts as too narrow."""


def people_beside(world: World, poses_world_robot: Array, count: int, rng: np.random.Generator) -> tuple[Person, ...]:
    """Place people who go to and fro beside the path of a robot, each on a straight stretch clear of it and of walls.

    Parameters
    ----------
    world : the walls.
    poses_world_robot : path of the robot, shape (n, 3), n >= 2 [m, m, rad].
    count : number of people.
    rng : source of stretches and speeds.

    Raises
    ------
    WorldError
        There is no room for them.
    """
    if count == 0:
        return ()
    walls = shapely.union_all(segments(world.walls.reshape(-1, 2, 2)))
    path = shapely.LineString(poses_world_robot[:, :2]).simplify(0.01)  # 1 cm off at most, for speed
    taken = walls.buffer(RADIUS).union(path.buffer(RADIUS + ROBOT_RADIUS))
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
    raise WorldError(f"world {name!r}: there is no room for a person beside the path of the robot")
