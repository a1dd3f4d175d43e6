"""Labels of observed corners: which corner of the world each of them is."""

import numpy as np
import numpy.typing as npt

from features.se2 import Array
from sim.worlds.world import World


def label_corners(
    world: World, wall_ids: npt.NDArray[np.int64], positions_world: Array, reach: float
) -> npt.NDArray[np.int64]:
    """Find the true corner of each observed corner: the nearest one of those whose two walls the scan hit.

    Parameters
    ----------
    world : the walls and their corners.
    wall_ids : wall that each beam of the scan hit, -1 for none, shape (n,).
    positions_world : observed corners, transformed to the world frame with the true pose, shape (k, 2) [m].
    reach : an observed corner farther than this from every such corner has no label [m].

    Returns
    -------
    Indices into ``world.corners``, shape (k,); -1 for none.
    """
    hit = np.zeros(len(world.walls) + 1, dtype=np.bool_)
    hit[wall_ids] = True
    hit[-1] = False  # -1 in wall_ids, no wall, has set it
    seen = np.flatnonzero(hit[world.corner_walls].all(axis=1))
    if len(seen) == 0:
        return np.full(len(positions_world), -1)
    distances = np.linalg.norm(positions_world[:, None] - world.corners[seen], axis=2)
    return np.where(distances.min(axis=1) <= reach, seen[distances.argmin(axis=1)], -1)
