"""A check of walls: overlaps, crossings, open ends and walls that are unusable."""

from collections.abc import Iterator
from typing import cast

import numpy as np
import numpy.typing as npt
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from features.se2 import Array

MEET = 1e-6
"""Walls nearer to each other than this meet [m]: files round coordinates to a micrometre."""

Indices = npt.NDArray[np.int64]


def findings(walls: Array) -> list[str]:
    """List what is wrong with walls, one line for each finding with its coordinates.

    Listed are walls without length or with coordinates that are not finite, walls that overlap, walls that cross, and
    what :func:`open_ends` lists. A wall may end on another one.

    Parameters
    ----------
    walls : end points ``x1 y1 x2 y2`` of each wall, world frame, shape (n, 4) [m].
    """
    finite = np.isfinite(walls).all(axis=1)
    empty = finite & (_lengths(walls) <= MEET)
    sound = np.flatnonzero(finite & ~empty)
    return [
        *(f"wall {k} has a coordinate that is not finite: {_wall(walls[k])}" for k in np.flatnonzero(~finite)),
        *(f"wall {k} has no length: {_wall(walls[k])}" for k in np.flatnonzero(empty)),
        *_overlaps_and_crossings(walls[sound], sound),
        *open_ends(walls),
    ]


def open_ends(walls: Array) -> list[str]:
    """List the outlines that are not closed, and any other ends of walls that meet no wall, one line for each.

    Parameters
    ----------
    walls : end points ``x1 y1 x2 y2`` of each wall, world frame, shape (n, 4) [m]; those without length, or with
        coordinates that are not finite, are ignored.
    """
    names = np.flatnonzero(np.isfinite(walls).all(axis=1) & (_lengths(walls) > MEET))
    walls = walls[names]
    first, second = _near(walls)
    ends, lines = walls.reshape(-1, 2, 2), segments(walls.reshape(-1, 2, 2))
    meets = np.zeros((len(walls), 2), dtype=np.bool_)
    for one, other in ((first, second), (second, first)):
        for end in (0, 1):
            points = np.asarray(shapely.points(ends[one, end]), dtype=np.object_)
            distances = shapely.distance(points, lines[other])  # pyright: ignore[reportUnknownMemberType]  # its keyword arguments are untyped
            near = distances <= MEET
            meets[one[near], end] = True
    joined = coo_array((np.ones(len(first)), (first, second)), shape=(len(walls), len(walls)))
    part = cast(npt.NDArray[np.int32], connected_components(joined, directed=False)[1])
    found: list[str] = []
    for label in np.unique(part[~meets.all(axis=1)]):
        members = np.flatnonzero(part == label)
        open_of = [(int(k), end) for k in members for end in (0, 1) if not meets[k, end]]
        is_chain = (part[first] == label).sum() == len(members) - 1
        if len(members) > 1 and len(open_of) == 2 and is_chain:
            a, b = (ends[k, end] for k, end in open_of)
            found.append(
                f"an outline of {len(members)} walls is not closed: it is open from {_at(a)} to {_at(b)}, "
                f"{np.hypot(*(b - a)):.6g} m"
            )
        else:
            found += [f"wall {names[k]} ends at {_at(ends[k, end])} and meets no other there" for k, end in open_of]
    return found


def segments(ends: Array) -> npt.NDArray[np.object_]:
    """Make line segments, shape (n,), of pairs of points, shape (n, 2, 2) [m]."""
    return np.atleast_1d(np.asarray(shapely.linestrings(ends), dtype=np.object_))


def _overlaps_and_crossings(walls: Array, names: Indices) -> Iterator[str]:
    first, second = _near(walls)
    shorter_first = _lengths(walls[first]) < _lengths(walls[second])
    a, b = walls[np.where(shorter_first, second, first)], walls[np.where(shorter_first, first, second)]
    along, other_along = a[:, 2:] - a[:, :2], b[:, 2:] - b[:, :2]
    length, other_length = _lengths(a), _lengths(b)
    starts, ends = b[:, :2] - a[:, :2], b[:, 2:] - a[:, :2]
    off = np.maximum(abs(_cross(along, starts)), abs(_cross(along, ends))) / length
    low, high = np.sort(np.stack([_dot(along, starts), _dot(along, ends)]) / length, axis=0)
    shared = np.minimum(high, length) - np.maximum(low, 0.0)
    overlap = (off <= MEET) & (shared > MEET)

    cross = _cross(along, other_along)
    slanted = np.where(overlap | (cross == 0.0), np.inf, cross)
    at, other_at = _cross(starts, other_along) / slanted * length, _cross(starts, along) / slanted * other_length
    crossing = (np.minimum(at, length - at) > MEET) & (np.minimum(other_at, other_length - other_at) > MEET)

    for k in np.flatnonzero(overlap | crossing):
        pair = f"walls {names[first[k]]} and {names[second[k]]}"
        if crossing[k]:
            yield f"{pair} cross at {_at(a[k, :2] + at[k] / length[k] * along[k])}"
        elif shared[k] > length[k] - MEET:
            yield f"{pair} are the same: {_wall(a[k])}"
        else:
            yield f"{pair} lie on each other over {shared[k]:.6g} m: {_wall(a[k])} and {_wall(b[k])}"


def _near(walls: Array) -> tuple[Indices, Indices]:
    """Return the pairs of walls that meet or cross, each once, the first index below the second, shape (k,) each."""
    lines = segments(walls.reshape(-1, 2, 2))
    first, second = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=MEET)
    once = first < second
    order = np.lexsort((second[once], first[once]))
    return first[once][order], second[once][order]


def _lengths(walls: Array) -> Array:
    return np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1])


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=1)


def _at(point: Array) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def _wall(wall: Array) -> str:
    return f"{_at(wall[:2])} to {_at(wall[2:])}"
