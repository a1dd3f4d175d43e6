"""Floor plans: the walls of a building from the free space inside it."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from features.se2 import Array
from sim.errors import WorldError
from sim.worlds.world import World

MERGE = 1e-6
"""Shapes are joined on a grid of this width, so that edges that differ by rounding alone become one [m]."""


def floor_plan(name: str, free: Sequence[shapely.Polygon], solid: Sequence[shapely.Polygon] = ()) -> World:
    """Make a world whose walls bound the free space: rooms, corridors and doorways, less the furniture in them.

    Parameters
    ----------
    name : short name, fit for a folder.
    free : shapes whose union is free, world frame [m]; doorways overlap or touch the rooms that they join.
    solid : shapes that are occupied, such as furniture, world frame [m]; one that touches a wall becomes part of it.

    Raises
    ------
    WorldError
        The free space is empty or falls into several parts.
    """
    space = shapely.difference(
        shapely.union_all(list(free), grid_size=MERGE), shapely.union_all(list(solid), grid_size=MERGE), grid_size=MERGE
    )
    if not isinstance(space, shapely.Polygon) or space.is_empty:
        parts = len(shapely.get_parts(space))
        raise WorldError(f"world {name!r}: its free space has {parts} parts: expected one, joined by doorways")
    return World.from_polygons(name, list(outlines(space)))


def outlines(shape: shapely.Geometry) -> Iterator[Array]:
    """Yield the vertices, shape (n, 2), of each ring of one or more polygons, without vertices on a straight line."""
    # simplify() always keeps the first vertex of a ring. A normalized ring starts at its least vertex, which lies on
    # the hull, so that it is a corner.
    for polygon in shapely.get_parts(shapely.simplify(shapely.normalize(shape), 0.0)):
        for ring in (polygon.exterior, *polygon.interiors):
            yield np.asarray(ring.coords)[:-1]
