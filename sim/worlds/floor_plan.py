"""Walls of a building from the free space inside it."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely

from features.se2 import Array
from sim.errors import WorldError
from sim.worlds.world import World

MERGE = 1e-6
"""Shapes are joined on a grid of this width, so that edges that coincide but for rounding become one [m]."""


def floor_plan(name: str, free: Sequence[shapely.Polygon], solid: Sequence[shapely.Polygon] = ()) -> World:
    """Make a world whose walls bound what is free: rooms, corridors and doorways, without what stands in them.

    Parameters
    ----------
    name : short name, fit for a folder.
    free : shapes whose union is free; rooms are joined by the doorways that overlap or touch them, world frame [m].
    solid : shapes that are not, such as furniture; one that stands against a wall becomes part of it.

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
    """Yield the vertices, shape (n, 2), of each ring of a polygon or of several, without those on a straight line."""
    # The ring starts at its least vertex, which lies on the hull: the one vertex that simplify() keeps is a true one.
    for polygon in shapely.get_parts(shapely.simplify(shapely.normalize(shape), 0.0)):
        for ring in (polygon.exterior, *polygon.interiors):
            yield np.asarray(ring.coords)[:-1]
