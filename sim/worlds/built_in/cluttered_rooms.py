"""Cluttered rooms: furnished rooms like real ones, with small, thin and round structure."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from features.se2 import Array, rotation
from sim.worlds.built_in.furniture import AT_WALLS, IN_ROOMS, Draw, Piece, arc
from sim.worlds.floor_plan import MERGE, floor_plan, outlines
from sim.worlds.world import World

_SIDES = (4.2, 12.0)
"""Shortest and longest side of a room without what opens off its walls [m]."""

_FLAT = 0.8
"""Shortest wall at which something stands or opens [m]: longer than the facets of a round one."""

_ASIDE = 0.25
"""Least length of wall beside what stands at it or opens off it [m]."""

_GAP = 0.005
"""Least distance between two pieces, and from a piece to a wall, such as a leaf from its jamb [m]."""

_BEYOND = 0.07
"""What opens off a wall is beyond it from this depth on [m], at which :data:`_BETWEEN` is from the room itself."""

_BETWEEN = 0.05
"""Least thickness of a wall between what opens off walls [m]."""

_ROBOT = 0.5
"""Space this clear of all walls is for the robot [m]: what :func:`sim.worlds.built_in.random_rooms.random_tour` asks
for."""

_NECK = 0.1
"""Half of the least width of that space [m], so that a tour gets from each part of it to the others."""

_KEPT = 0.35
"""Least share of that space of the empty room that furniture leaves."""

_MIDDLE = 50.0
"""Area of a room of middle size [m^2]; the most that a room has of a kind grows in proportion."""

_TRIES = 20
"""Places that are tried for a piece before it is left out."""


def cluttered_room(seed: int) -> World:
    """Draw a furnished room of a mixture of small, thin and round structure.

    It has some of: walls that lean, oblique and round ones, niches of 8 to 20 cm, cupboards 5 to 25 cm off the wall,
    doors ajar in openings with reveals, round bays, legs of tables and chairs, round columns, curved desks, boxes, and
    pillars of 5 to 15 cm. A robot has one connected space in it that is 0.5 m clear of everything.

    Parameters
    ----------
    seed : of all randomness; the same seed gives the same room.
    """
    rng = np.random.default_rng(seed)
    shell = _shell(rng)
    least = _KEPT * shell.buffer(-_ROBOT).area
    walls = _flat_walls(shell)
    room = shell
    for _, piece in _pieces(AT_WALLS, shell.area, rng):
        room = _furnish_wall(room, walls, piece, least, rng)
    for kind, piece in _pieces(IN_ROOMS, shell.area, rng):
        for _ in range(_TRIES):
            centre, angle = rng.uniform(*np.reshape(shell.bounds, (2, 2))), rng.uniform(-math.pi, math.pi)
            furnished = _placed(room, piece.at(centre, angle), least)
            if furnished is not None:
                room = _seat(furnished, piece, centre, angle, least, rng) if kind == "table" else furnished
                break
    # Rounding leaves walls of a micrometre where what opens off a wall joins the room.
    return floor_plan(f"cluttered-room-{seed}", [shapely.remove_repeated_points(room, 10.0 * MERGE)])


def _pieces(
    kinds: Mapping[str, tuple[Draw, float, int]], area: float, rng: np.random.Generator
) -> Iterator[tuple[str, Piece]]:
    """Draw the pieces of some kinds for a room of an area [m^2]."""
    for kind, (draw, probability, most) in kinds.items():
        if rng.random() < probability:
            for _ in range(int(rng.integers(1, math.ceil(most * area / _MIDDLE), endpoint=True))):
                yield kind, draw(rng)


def _shell(rng: np.random.Generator) -> shapely.Polygon:
    """Draw an empty room."""
    while True:
        width, height = rng.uniform(*_SIDES), rng.uniform(*_SIDES)
        corners = np.array([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)])
        if rng.random() < 0.5:  # one wall leans by up to 12 deg
            corners[2] += [0.0, -math.tan(math.radians(rng.uniform(2.0, 12.0))) * width]
        corners = corners @ rotation(rng.uniform(-math.pi, math.pi)).T
        vertices = [_corner(rng, corners[k - 1], corners[k], corners[(k + 1) % 4]) for k in range(4)]
        shell = shapely.Polygon(np.vstack(vertices))
        if shell.is_valid and _is_one(shell.buffer(-_ROBOT)) and shell.area > 0.6 * _SIDES[0] ** 2:
            return shell


def _corner(rng: np.random.Generator, before: Array, corner: Array, after: Array) -> Array:
    """Draw the vertices, shape (n, 2) [m], of a corner of a room: plain, stepped in, cut off, or round."""
    lengths = math.hypot(*(before - corner)), math.hypot(*(after - corner))
    back, on = (before - corner) / lengths[0], (after - corner) / lengths[1]
    most = 0.4 * min(lengths)
    kind = rng.random()
    if kind < 0.1:
        a, b = rng.uniform(0.3, most, 2)
        return np.array([corner + a * back, corner + a * back + b * on, corner + b * on])
    if kind < 0.22:
        a = rng.uniform(0.6, most)
        b = min(most, a * math.tan(math.radians(rng.uniform(30.0, 60.0))))
        return np.array([corner + a * back, corner + b * on])
    half = math.acos(float(back @ on)) / 2.0
    if kind < 0.27 and most * math.tan(half) > 1.0:
        radius = rng.uniform(1.0, min(3.0, most * math.tan(half)))
        inwards = (back + on) / np.hypot(*(back + on))
        first = math.atan2(*(-inwards)[::-1]) - (math.pi / 2.0 - half)
        return arc(corner + radius / math.sin(half) * inwards, radius, first, first + math.pi - 2.0 * half)
    return corner[None]


def _flat_walls(shell: shapely.Polygon) -> list[tuple[Array, Array]]:
    """Return the ends of the flat walls of an empty room, each with the room on its left."""
    (ring,) = outlines(shell)
    ring = ring if shapely.LinearRing(ring).is_ccw else ring[::-1]
    pairs = zip(ring, np.roll(ring, -1, axis=0), strict=True)
    return [(start, end) for start, end in pairs if np.hypot(*(end - start)) >= _FLAT]


def _furnish_wall(
    room: shapely.Polygon, walls: list[tuple[Array, Array]], piece: Piece, least: float, rng: np.random.Generator
) -> shapely.Polygon:
    """Put a piece at one of the walls, if it fits anywhere."""
    low, _, high, _ = shapely.union_all([piece.solid, piece.free]).bounds
    for _ in range(_TRIES):
        start, end = walls[int(rng.integers(len(walls)))]
        length = math.hypot(*(end - start))
        along = (end - start) / length
        if length < high - low + 2.0 * _ASIDE:
            continue
        origin = start + rng.uniform(_ASIDE + high, length - _ASIDE + low) * along
        angle = math.atan2(-along[1], -along[0])  # x against the wall, so that y is out of the room
        if room.distance(piece.beyond(_BEYOND).at(origin, angle).free) < _BETWEEN:
            continue
        furnished = _placed(room, piece.at(origin, angle), least)
        if furnished is not None:
            return furnished
    return room


def _seat(
    room: shapely.Polygon, table: Piece, centre: Array, angle: float, least: float, rng: np.random.Generator
) -> shapely.Polygon:
    """Draw up to four chairs at the sides of a table, pushed in more or less."""
    half = table.solid.bounds[2:]
    for _ in range(int(rng.integers(0, 5))):
        side = int(rng.integers(4))
        off = half[side % 2] + rng.uniform(-0.15, 0.45)
        aside = rng.uniform(-0.5, 0.5) * half[1 - side % 2]
        place = np.array([off, aside]) if side % 2 == 0 else np.array([aside, off])
        place = -place if side > 1 else place
        chair = IN_ROOMS["chair"][0](rng).at(centre + rotation(angle) @ place, angle + rng.normal(0.0, 0.3))
        furnished = _placed(room, chair, least)
        room = room if furnished is None else furnished
    return room


def _placed(room: shapely.Polygon, piece: Piece, least: float) -> shapely.Polygon | None:
    """Put a piece into a room; None if it does not fit or leaves a robot less than the least space [m^2]."""
    space = shapely.union(room, piece.free, grid_size=MERGE)
    if not (piece.solid.is_empty or shapely.contains_properly(space, piece.solid)):
        return None
    if space.boundary.distance(piece.solid) < _GAP:  # nan if nothing is solid
        return None
    space = shapely.difference(space, piece.solid, grid_size=MERGE)
    clear = space.buffer(-_ROBOT)
    return space if isinstance(space, shapely.Polygon) and _is_one(clear) and clear.area >= least else None


def _is_one(space: BaseGeometry) -> bool:
    """Whether a space is not empty and in one piece, without a neck."""
    return all(
        isinstance(part, shapely.Polygon) and not part.is_empty for part in (space, shapely.buffer(space, -_NECK))
    )
