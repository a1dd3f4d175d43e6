"""What stands in a room and what opens off its walls, each as shapes in a frame of its own.

Curves are polygons of facets so fine that no lidar resolves them: :data:`SAGITTA` and :data:`TURN` bound them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from features.se2 import Array

SAGITTA = 5e-4
"""Largest distance of a facet from its curve [m]: far below the noise of a range."""

TURN = math.radians(8.0)
"""Largest angle between neighbouring facets of a curve [rad]: below :data:`sim.worlds.corners.BLUNT`, so that where
they meet is no corner."""

_INTO_WALL = 0.05
"""What opens off a wall overlaps the room by this [m], so that rounding leaves no sliver of wall between them."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of furniture, or a part of a building that opens off a wall.

    The frame of what stands at a wall has its origin on the wall, x along it and y out of the room.

    Parameters
    ----------
    solid : what is occupied [m]; may be empty.
    free : what is free beyond the wall [m]; empty for furniture.
    """

    solid: BaseGeometry
    free: BaseGeometry = shapely.Polygon()  # noqa: RUF009, immutable

    def at(self, origin: Array, angle: float) -> "Piece":
        """Turn the piece about the origin of its frame by an angle [rad], and carry that origin, shape (2,), along."""
        return Piece(_moved(self.solid, origin, angle), _moved(self.free, origin, angle))

    def beyond(self, depth: float) -> "Piece":
        """Return what is free beyond the wall from a depth on [m]."""
        low, _, high, top = self.free.bounds if not self.free.is_empty else (0.0, 0.0, 0.0, 0.0)
        return Piece(shapely.Polygon(), shapely.intersection(self.free, shapely.box(low, depth, high, max(top, depth))))


class Draw(Protocol):
    """Draws a piece of one kind."""

    def __call__(self, rng: np.random.Generator, /) -> Piece:
        """Draw the sizes of a piece."""
        ...


def arc(centre: Array, radius: float, start: float, end: float) -> Array:
    """Lay points on an arc from one direction to another [rad], both included, shape (n, 2) [m]."""
    turn = min(TURN, math.sqrt(8.0 * SAGITTA / radius))  # the sagitta of a facet is radius turn^2 / 8
    angles = np.linspace(start, end, 1 + math.ceil(abs(end - start) / turn))
    return centre + radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _disc(centre: Array, radius: float) -> shapely.Polygon:
    return shapely.Polygon(arc(centre, radius, 0.0, 2.0 * math.pi)[:-1])


def _rectangle(centre: Array, length: float, width: float) -> shapely.Polygon:
    return shapely.Polygon(centre + np.array([length, width]) * [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])


def _moved(shape: BaseGeometry, origin: Array, angle: float) -> BaseGeometry:
    c, s = math.cos(angle), math.sin(angle)

    def move(points: Array) -> Array:
        return points @ np.array([[c, s], [-s, c]]) + origin

    return shapely.transform(shape, move)


def _legs(rng: np.random.Generator, length: float, width: float, thickest: float) -> BaseGeometry:
    """Draw four round or square legs, 2 cm thick or more, at the corners of a rectangle [m]."""
    thickness = rng.uniform(0.02, thickest)
    places = [np.array([x, y]) for x in (-length / 2.0, length / 2.0) for y in (-width / 2.0, width / 2.0)]
    if rng.random() < 0.5:
        return shapely.MultiPolygon([_disc(place, thickness / 2.0) for place in places])
    return shapely.MultiPolygon([_rectangle(place, thickness, thickness) for place in places])


def _table(rng: np.random.Generator) -> Piece:
    return Piece(_legs(rng, rng.uniform(0.8, 1.8), rng.uniform(0.55, 0.9), 0.06))


def _chair(rng: np.random.Generator) -> Piece:
    return Piece(_legs(rng, rng.uniform(0.36, 0.46), rng.uniform(0.36, 0.46), 0.04))


def _column(rng: np.random.Generator) -> Piece:
    return Piece(_disc(np.zeros(2), rng.uniform(0.08, 0.4)))


def _pillar(rng: np.random.Generator) -> Piece:
    """Draw a square or oblong pillar of 5 to 15 cm, or a pipe of that."""
    if rng.random() < 0.3:
        return Piece(_disc(np.zeros(2), rng.uniform(0.05, 0.15) / 2.0))
    return Piece(_rectangle(np.zeros(2), *rng.uniform(0.05, 0.15, 2)))


def _pillar_at_wall(rng: np.random.Generator) -> Piece:
    pillar = _pillar(rng)
    return pillar.at(np.array([0.0, -pillar.solid.bounds[3] - rng.uniform(0.01, 0.3)]), 0.0)


def _box(rng: np.random.Generator) -> Piece:
    """Draw a cabinet, a chest or a machine, down to the floor."""
    return Piece(_rectangle(np.zeros(2), rng.uniform(0.4, 1.4), rng.uniform(0.35, 0.7)))


def _curved_desk(rng: np.random.Generator) -> Piece:
    """Draw a desk of a reception, closed down to the floor: a sector of a ring."""
    inner, depth, half = rng.uniform(0.6, 1.5), rng.uniform(0.4, 0.8), math.radians(rng.uniform(25.0, 70.0))
    centre = np.array([-inner, 0.0])
    return Piece(shapely.Polygon(np.vstack([arc(centre, inner + depth, -half, half), arc(centre, inner, half, -half)])))


def _niche(rng: np.random.Generator) -> Piece:
    width, depth = rng.uniform(0.4, 1.6), rng.uniform(0.08, 0.2)
    return Piece(shapely.Polygon(), shapely.box(-width / 2.0, -_INTO_WALL, width / 2.0, depth))


def _cupboard(rng: np.random.Generator) -> Piece:
    """Draw a shelf or a cupboard that stands off the wall, not always quite along it."""
    width, depth, gap = rng.uniform(0.5, 1.8), rng.uniform(0.25, 0.6), rng.uniform(0.05, 0.25)
    tilt = math.radians(rng.uniform(-2.0, 2.0)) if rng.random() < 0.4 else 0.0
    gap = max(gap, 0.05 + width / 2.0 * math.sin(abs(tilt)))
    return Piece(_moved(_rectangle(np.array([0.0, -depth / 2.0]), width, depth), np.array([0.0, -gap]), tilt))


def _door(rng: np.random.Generator) -> Piece:
    """Draw an opening with reveals, a piece of a corridor behind it, and a leaf of 4 cm ajar, to either side."""
    width, reveal, angle = rng.uniform(0.75, 1.0), rng.uniform(0.1, 0.25), math.radians(rng.uniform(10.0, 80.0))
    depth, left, right = rng.uniform(0.5, 0.95), *rng.uniform(0.1, 0.8, 2)
    opening = shapely.box(0.0, -_INTO_WALL, width, reveal + _INTO_WALL)
    corridor = shapely.box(-left, reveal, width + right, reveal + depth)
    leaf = shapely.box(0.01, 0.0, width - 0.01, 0.04)
    leaf = affinity.rotate(leaf, -angle, origin=(0.01, 0.0), use_radians=True)
    if rng.random() < 0.4 and (width - 0.02) * math.sin(angle) + 0.04 < depth - 0.05:  # into the corridor
        leaf = affinity.scale(leaf, 1.0, -1.0, origin=(0.0, reveal / 2.0))
    piece = Piece(leaf, shapely.union(opening, corridor))
    side = rng.choice([-1.0, 1.0])
    solid, free = (
        affinity.scale(affinity.translate(shape, -width / 2.0), side, 1.0, origin=(0.0, 0.0))
        for shape in (piece.solid, piece.free)
    )
    return Piece(solid, free)


def _bay(rng: np.random.Generator) -> Piece:
    """Draw a round bay; its wall meets the straight one at 30 deg or more."""
    chord = rng.uniform(1.2, 4.0)
    radius = rng.uniform(max(1.0, chord / 2.0), min(3.0, chord))
    half = math.asin(min(1.0, chord / 2.0 / radius))
    centre = np.array([0.0, -radius * math.cos(half)])
    bow = arc(centre, radius, math.pi / 2.0 - half, math.pi / 2.0 + half)
    mouth = [(-chord / 2.0, -_INTO_WALL), (chord / 2.0, -_INTO_WALL)]
    return Piece(shapely.Polygon(), shapely.Polygon(np.vstack([bow, mouth])))


AT_WALLS: Mapping[str, tuple[Draw, float, int]] = MappingProxyType(
    {
        "bay": (_bay, 0.25, 1),
        "door": (_door, 0.5, 2),
        "niche": (_niche, 0.5, 3),
        "cupboard": (_cupboard, 0.6, 3),
        "pillar": (_pillar_at_wall, 0.4, 2),
    }
)
"""What stands at walls or opens off them, by kind: the probability that a room has any, and how many of it a room of
middle size has at most. Round ones are rarer than flat ones, as in buildings."""

IN_ROOMS: Mapping[str, tuple[Draw, float, int]] = MappingProxyType(
    {
        "curved desk": (_curved_desk, 0.35, 1),
        "column": (_column, 0.3, 2),
        "box": (_box, 0.6, 2),
        "table": (_table, 0.6, 2),
        "chair": (_chair, 0.5, 3),
        "pillar": (_pillar, 0.3, 2),
    }
)
"""What stands in the middle of a room, by kind, with the same."""
