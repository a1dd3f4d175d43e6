"""Outlines of the occupied cells of a grid, as straight walls."""

import math
from typing import cast

import numpy as np
import numpy.typing as npt
import shapely
from contourpy import FillType, contour_generator

from features.se2 import Array

SPLIT = 0.75
"""A piece of the boundary is split where it is farther than this from a straight line [cells].

The boundary of a line drawn into a grid lies within half a cell of the line; the rest is a margin."""

STRAIGHT = 0.9
"""Two neighbouring pieces are joined where both lie within this distance of one line [cells]; more than :data:`SPLIT`,
so that the pieces of a straight wall are joined wherever it was split."""

THIN = 2.0
"""An outline that is no wider than this becomes a rectangle [cells]: a wall one cell thick, or a leg of a table."""

SAME = 1e-6
"""Vertices no farther apart than this are one [cells]: they differ by rounding alone."""

NEAR = 2.0
"""Largest distance of a corner from the boundary, which cuts the corner off [cells]: up to two cells where it is
sharp."""


def trace_outlines(occupied: npt.NDArray[np.bool_]) -> list[Array]:
    """Outline the occupied cells by straight walls at any angle.

    The boundary runs through the middles of the edges between occupied and free cells. It is split where it bends
    (Douglas and Peucker 1973), a line is fitted to each piece (total least squares), and neighbouring lines are
    intersected.

    Parameters
    ----------
    occupied : whether each cell is occupied, shape (rows, columns); the cell of row r and column c reaches from
        (c, r) to (c + 1, r + 1).

    Returns
    -------
    Vertices of each outline, shape (n, 2), x y [cells]; the last one is joined to the first.
    """
    padded: npt.NDArray[np.bool_] = np.pad(occupied, 1)
    rows, columns = padded.shape
    centres_x = np.arange(columns, dtype=np.float64) - 0.5
    centres_y = np.arange(rows, dtype=np.float64) - 0.5
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
    """Roll the points of a ring, shape (n, 2), to start at the one farthest from their mean.

    That point lies on the hull, so that it is a bend and not on a straight piece.
    """
    first = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())
    return np.roll(ring, -first, axis=0)


def _outline(ring: Array, vertices: Array) -> Array:
    """Return the outline, shape (m, 2), of a ring, shape (n, 2): a rectangle if thin, else :func:`_straightened`."""
    rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shapely.LinearRing(ring)))[:-1]
    width = np.hypot(*(rectangle[1:3] - rectangle[:2]).T).min()
    return rectangle if width <= THIN else _straightened(ring, vertices)


def _straightened(ring: Array, vertices: Array) -> Array:
    """Return the vertices, shape (m, 2), where the lines through neighbouring pieces of a ring, shape (n, 2), meet.

    ``vertices``, shape (k, 2), are the points where the ring was split; those without a bend are removed, the
    straightest first.
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
    corners: list[Array] = []
    for before, behind in zip([walls[-1], *walls[:-1]], walls, strict=True):
        corner = _intersect(ring[at[behind]], lines[before], lines[behind])
        corners.append(ring[at[behind]] if corner is None else corner)
    outline = np.array(corners)
    # Where three walls meet in one point, the middle one has no length.
    kept = np.hypot(*(outline - np.roll(outline, 1, axis=0)).T) > SAME
    return outline[kept] if kept.sum() >= 3 else ring[at]


def _without_cuts(ring: Array, at: list[int], lines: list[tuple[Array, Array]]) -> list[int]:
    """List the pieces that are walls, without short pieces that cut off a corner where their two neighbours meet."""
    walls: list[int] = []
    for k, start in enumerate(at):
        end = at[(k + 1) % len(at)]
        short = np.hypot(*(ring[end] - ring[start])) < NEAR
        between_walls = len(at) > 3 and 0 < k < len(at) - 1 and k - 1 in walls
        if not (short and between_walls and _intersect(ring[start], lines[k - 1], lines[k + 1]) is not None):
            walls.append(k)
    return walls if len(walls) >= 3 else list(range(len(at)))


def _bend(ring: Array, at: list[int], k: int) -> float:
    """Return how far the pieces before and after the k-th vertex deviate from one line through both [cells]."""
    start, vertex, end = at[k - 1], at[k], at[(k + 1) % len(at)]
    if (ring[vertex] - ring[start]) @ (ring[end] - ring[vertex]) <= 0.0:
        return math.inf
    shorter = min((vertex - start) % len(ring), (end - vertex) % len(ring))
    points = _piece(ring, start, end)
    point, along = _line(points)
    # The end points may belong to the next walls, but a short piece has few others.
    tried = points[1:-1] if shorter > 3 else points
    return float(abs((tried - point) @ np.array([-along[1], along[0]])).max())


def _piece(ring: Array, start: int, end: int) -> Array:
    """Return the points of a ring from one index to another, both included."""
    return np.take(ring, range(start, end + 1 if end > start else end + 1 + len(ring)), axis=0, mode="wrap")


def _line(points: Array) -> tuple[Array, Array]:
    """Fit a line to a piece, shape (n, 2), by total least squares; return a point on it and its direction.

    The end points are left out: there the boundary cuts the corner, so that they belong to neither wall.
    """
    inner = points[1:-1] if len(points) > 3 else points
    mean = inner.mean(axis=0)
    return mean, np.linalg.svd(inner - mean, full_matrices=False)[2][0]


def _intersect(vertex: Array, line: tuple[Array, Array], other: tuple[Array, Array]) -> Array | None:
    """Intersect two lines; return the point, shape (2,), or None where it is not near the vertex."""
    (point, along), (other_point, other_along) = line, other
    cross = along[0] * other_along[1] - along[1] * other_along[0]
    offset = other_point - point
    if cross == 0.0:
        return None
    corner = point + (offset[0] * other_along[1] - offset[1] * other_along[0]) / cross * along
    return corner if np.hypot(*(corner - vertex)) <= NEAR else None
