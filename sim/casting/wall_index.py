"""A tree of bounding boxes over walls, built once for a world, so that a cast tests only the walls near its beams."""

from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from features.se2 import Array

LEAF = 8
"""Largest number of walls in a leaf: with fewer, the tree has more boxes to test; with more, more walls are tested in
vain."""


class WallIndex(NamedTuple):
    """A complete binary tree of bounding boxes, stored as a heap: the children of node k are 2 k + 1 and 2 k + 2.

    Parameters
    ----------
    boxes : ``x_min y_min x_max y_max`` of the walls below each node, shape (2 m - 1, 4), world frame [m].
    bounds : leaf j, which is node m - 1 + j, holds the walls ``bounds[j] <= k < bounds[j + 1]``, shape (m + 1,).
    walls : end points ``x1 y1 x2 y2`` in the order of the leaves, shape (n, 4), world frame [m].
    ids : number of each of these walls in the order in which they were given, shape (n,).
    """

    boxes: Array
    bounds: npt.NDArray[np.int64]
    walls: Array
    ids: npt.NDArray[np.int64]

    @classmethod
    def of(cls, walls: Array, kept: npt.NDArray[np.bool_] | None = None) -> Self:
        """Build the tree over walls, shape (n, 4), world frame [m], or over those that are ``kept``, shape (n,).

        The walls of each node are halved at the median of their midpoints, along the longer side of their extent.
        """
        numbers = np.arange(len(walls)) if kept is None else np.flatnonzero(kept)
        n = len(numbers)
        levels = max(0, int(np.ceil(np.log2(max(n, 1) / LEAF))))
        corners = walls[numbers].reshape(-1, 2, 2)
        middles = corners.sum(axis=1)
        ids = np.arange(n)
        for level in range(levels):
            starts = _bounds(n, level)[:-1]
            extents = np.maximum.reduceat(middles[ids], starts) - np.minimum.reduceat(middles[ids], starts)
            node = np.repeat(np.arange(len(starts)), np.diff(_bounds(n, level)))
            ids = ids[np.lexsort((middles[ids, extents.argmax(axis=1)[node]], node))]
        boxes = np.array([[np.inf, np.inf, -np.inf, -np.inf]])
        if n > 0:
            low, high = corners.min(axis=1)[ids], corners.max(axis=1)[ids]
            starts = [_bounds(n, level)[:-1] for level in range(levels + 1)]
            boxes = np.vstack([np.hstack([np.minimum.reduceat(low, k), np.maximum.reduceat(high, k)]) for k in starts])
        return cls(boxes, _bounds(n, levels), walls[numbers[ids]], numbers[ids])


def _bounds(n: int, level: int) -> npt.NDArray[np.int64]:
    """Return the bounds of the walls of each node of a level, shape (2^level + 1,).

    The bounds of a level are among those of the level below.
    """
    parts = np.arange(2**level + 1, dtype=np.int64)
    return parts * n >> level
