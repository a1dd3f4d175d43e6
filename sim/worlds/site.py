"""A site: the walls of a world as they were drawn, not checked yet, and a path through them."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from features.se2 import Array
from sim.worlds.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """Walls as a built-in world or a file gives them, and a path of a robot.

    The walls may be unusable; :meth:`world` makes a world of them or says what is wrong.

    Parameters
    ----------
    name : short name, fit for a folder.
    walls : end points ``x1 y1 x2 y2`` of each wall, world frame, shape (n, 4) [m].
    glass : whether each wall is of glass, shape (n,).
    waypoints : path of a robot, world frame, shape (k, 2) [m]; None where there is none.
    """

    name: str
    walls: Array
    glass: npt.NDArray[np.bool_]
    waypoints: Array | None

    @classmethod
    def of(cls, world: World, waypoints: npt.ArrayLike) -> Self:
        """Make a site of a world and a path through it, shape (k, 2), world frame [m]."""
        return cls(world.name, world.walls, world.glass, np.asarray(waypoints, dtype=np.float64))

    def world(self) -> World:
        """Make the world of these walls.

        Raises
        ------
        WorldError
            There is no wall, a coordinate is not finite, or a wall has no length.
        """
        return World(self.name, self.walls, self.glass)
