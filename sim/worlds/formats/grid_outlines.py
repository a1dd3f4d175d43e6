"""Outlines of the occupied cells of a grid as straight walls."""

import math
from typing import cast

import numpy as np
import numpy.typing as npt
import shapely
from contourpy import FillType, contour_generator

from features.se2 import Array

SPLIT = 0.75
STRAIGHT = 0.9
"""How far a boundary is off a straight wall before it is split, and two pieces off one line to be two [cells].

Where a line is drawn into a grid, the middles of the cell edges lie within half a cell of it."""

THIN = 2.0
"""What is no wider becomes a rectangle: a wall one cell thick, a leg of a table [cells]."""

SAME = 1e-6
"""Vertices no farther apart are one [cells]."""

NEAR = 2.0
"""A corner is this near to where the boundary cuts it [cells]."""


def trace(occupied: npt.NDArray[np.bool_]) -> list[Array]:
    """Outline the occupied cells by straight walls at any angle.

    The boundary runs through the middles of the edges between occupied and free cells. It is split where it bends
    (Douglas and Peucker 1973), a line is fitted to each piece (total least squares), and neighbouring lines are
    intersected.

    Parameters
    ----------
    occupied : whether each cell is, shape (rows, columns); the cell of row r and column c reaches from (c, r) to
        (c + 1, r + 1).

    Returns
    -------
    Vertices of each outline, shape (n, 2), x y [cells]; the last one is joined to the first.
    """
    padded = np.pad(occupied, 1)
    centres_x, centres_y = np.arange(padded.shape[1]) - 0.5, np.arange(padded.shape[0]) - 0.5
    generator = contour_generator(centres_x, centres_y, padded.astype(np.float64), fill_type=FillType.OuterOffset)
    filled = cast(tuple[list[Array], list[npt.NDArray[np.uint32]]], generator.filled(0.5, np.inf))
    rings: list[Array] = []
    for points, ends in zip(*filled, strict=True):
        rough = [_turned(ring[:-1]) for ring in np.split(points, ends[1:-1])]
        bent = shapely.simplify(shapely.Polygon(rough[0], rough[1:]), SPLIT)
        outer_and_holes = [np.asarray(ring.coords)[:-1] for ring in (bent.exterior, *bent.interiors)]
        fitted = [_outline(ring, vertices) for ring, vertices in zip(rough, outer_and_holes, strict=True)]
        rings += fitted if shapely.Polygon(fitted[0], fitted[1:]).is_valid else outer_and_holes
    return rings


def _turned(ring: Array) -> Array:
    """Points of a ring, shape (n, 2), from the farthest one from their mean on: it is on the hull, so it is a bend."""
    first = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())
    return np.roll(ring, -first, axis=0)


def _outline(ring: Array, vertices: Array) -> Array:
    """Outline, shape (m, 2), of a ring, shape (n, 2): its rectangle if it is thin, else :func:`_straightened`."""
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.LinearRing(ring)))[:-1]
    width = np.hypot(*(rectangle[1:3] - rectangle[:2]).T).min()
    return rectangle if width <= THIN else _straightened(ring, vertices)


def _straightened(ring: Array, vertices: Array) -> Array:
    """Vertices, shape (m, 2), of a ring, shape (n, 2), where the lines through its pieces meet.

    ``vertices``, shape (k, 2), are those points of the ring where it was split; those that no bend asks for are left
    out, the straightest first.
    """
    at = [int((ring == vertex).all(axis=1).argmax()) for vertex in vertices]
    bends = [_bend(ring, at, k) for k in range(len(at))]
    while len(at) > 3 and min(bends) <= STRAIGHT:
        k = bends.index(min(bends))
        del at[k], bends[k]
        for neighbour in ((k - 1) % len(at), k % len(at)):
            bends[neighbour] = _bend(ring, at, neighbour)
    lines = [_line(_piece(ring, start, end)) for start, end in zip(at, [*at[1:], at[0]], strict=True)]
    walls = _without_cuts(ring, at, lines)
    corners = []
    for before, behind in zip([walls[-1], *walls[:-1]], walls, strict=True):
        meet = _meet(ring[at[behind]], lines[before], lines[behind])
        corners.append(ring[at[behind]] if meet is None else meet)
    outline = np.array(corners)
    # Three walls may meet in a point; the one between them has no length then.
    kept = np.hypot(*(outline - np.roll(outline, 1, axis=0)).T) > SAME
    return outline[kept] if kept.sum() >= 3 else ring[at]


def _without_cuts(ring: Array, at: list[int], lines: list[tuple[Array, Array]]) -> list[int]:
    """List the pieces that are walls: not those that cut a corner, behind which the two next to them meet."""
    walls: list[int] = []
    for k, start in enumerate(at):
        end = at[(k + 1) % len(at)]
        short = np.hypot(*(ring[end] - ring[start])) < NEAR
        between_walls = len(at) > 3 and 0 < k < len(at) - 1 and k - 1 in walls
        if not (short and between_walls and _meet(ring[start], lines[k - 1], lines[k + 1]) is not None):
            walls.append(k)
    return walls if len(walls) >= 3 else list(range(len(at)))


def _bend(ring: Array, at: list[int], k: int) -> float:
    """How far the pieces before and behind the k-th vertex are off the one line through both of them [cells]."""
    start, vertex, end = at[k - 1], at[k], at[(k + 1) % len(at)]
    if (ring[vertex] - ring[start]) @ (ring[end] - ring[vertex]) <= 0.0:
        return math.inf
    shorter = min((vertex - start) % len(ring), (end - vertex) % len(ring))
    points = _piece(ring, start, end)
    point, along = _line(points)
    # The end points may belong to the walls beyond; of a short piece they may be all there is.
    tried = points[1:-1] if shorter > 3 else points
    return float(abs((tried - point) @ np.array([-along[1], along[0]])).max())


def _piece(ring: Array, start: int, end: int) -> Array:
    """Points of a ring from one index to another."""
    return np.take(ring, range(start, end + 1 if end > start else end + 1 + len(ring)), axis=0, mode="wrap")


def _line(points: Array) -> tuple[Array, Array]:
    """Point and direction of the line through a piece, shape (n, 2), by total least squares.

    At its ends the boundary cuts the corner, so that the end points belong to neither wall.
    """
    inner = points[1:-1] if len(points) > 3 else points
    mean = inner.mean(axis=0)
    return mean, np.linalg.svd(inner - mean, full_matrices=False)[2][0]


def _meet(vertex: Array, line: tuple[Array, Array], other: tuple[Array, Array]) -> Array | None:
    """Intersect two lines, shape (2,); None where they do not meet near the vertex."""
    (point, along), (other_point, other_along) = line, other
    cross = along[0] * other_along[1] - along[1] * other_along[0]
    offset = other_point - point
    if cross == 0.0:
        return None
    meet = point + (offset[0] * other_along[1] - offset[1] * other_along[0]) / cross * along
    return meet if np.hypot(*(meet - vertex)) <= NEAR else None
