"""Which corner of the world an observation is."""

import numpy as np
import numpy.typing as npt

from features.se2 import Array
from sim.worlds.world import World


def label_corners(
    world: World, wall_ids: npt.NDArray[np.int64], positions_world: Array, reach: float
) -> npt.NDArray[np.int64]:
    """Find the true corner of each observed one: the nearest of those whose two walls the scan hit.

    Parameters
    ----------
    world : the walls and their corners.
    wall_ids : wall that each beam of the scan hit, -1 for none, shape (n,).
    positions_world : observed corners, carried to the world frame with the true pose, shape (k, 2) [m].
    reach : an observation farther than this from every such corner is of none of them [m].

    Returns
    -------
    Indices into ``world.corners``, shape (k,); -1 for none.
    """
    hit = np.zeros(len(world.walls) + 1, dtype=np.bool_)
    hit[wall_ids] = True
    hit[-1] = False  # where -1, no wall, was counted
    seen = np.flatnonzero(hit[world.corner_walls].all(axis=1))
    if len(seen) == 0:
        return np.full(len(positions_world), -1)
    distances = np.linalg.norm(positions_world[:, None] - world.corners[seen], axis=2)
    return np.where(distances.min(axis=1) <= reach, seen[distances.argmin(axis=1)], -1)
