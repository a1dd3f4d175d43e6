"""Random rooms, and random poses and paths in them.

The limits of the sizes are chosen so that a scan from anywhere in a room hits most walls with many beams, and shows
corners of all opening angles that the paper has.
"""

import math

import numpy as np
import numpy.typing as npt
import shapely

from features.se2 import Array, Pose, pose, rotation
from sim.errors import WorldError
from sim.worlds.world import World

_SIDES = (4.4, 10.0)
"""Shortest and longest side of a room without its niches, which add up to a metre on each side [m]."""

_DEPTHS = (0.45, 1.0)
"""Least and largest depth of niches and cabinets [m]."""

_WIDTHS = (0.9, 2.0)
"""Least and largest width of niches and cabinets at their mouth [m]."""

_MARGIN = 0.6
"""Length of wall on either side of a niche or cabinet, at least [m]."""

_SPLAYS = (61.0, 119.0)
"""Least and largest opening angle at the mouth of a niche or cabinet whose sides are not square to the wall [deg]."""

_WIDEST = math.radians(139.5)
"""Largest opening angle of the two corners where a corner of the room is cut off [rad]."""

_WALL_GAP = 0.35
"""Least distance of walls of the outline that share no vertex [m], so that no gap is too narrow to see into."""

_PILLAR_GAP = 0.8
"""Least distance from a pillar to any wall [m], so that a robot passes on each side."""

_MAX_PILLARS = 4
"""Largest number of pillars: more would hide most of the walls."""

_LEG = 1.0
"""Least length of a leg of a random tour [m]: well above the reach of a robot, 0.15 m."""

_BATCH = 64
"""Number of places that are drawn at once."""

_MAX_BATCHES = 200
"""Number of batches before the search gives up: it misses free space of 0.1 % of the area once in 360,000 searches."""


def random_room(seed: int) -> World:
    """Draw a room with niches, cabinets, oblique walls, and up to four free-standing pillars.

    The room is 4 m to 12 m long and wide, its corners open by 60 deg to 140 deg, most by 90 deg, and no two walls cross
    or come near each other. A pillar without a free place is left out.

    Parameters
    ----------
    seed : of all randomness; the same seed gives the same room.
    """
    rng = np.random.default_rng(seed)
    polygons = [_outline(rng)]
    walls = _polygon_walls(polygons[0])
    for _ in range(int(rng.integers(0, _MAX_PILLARS + 1))):
        shape = _pillar_shape(rng)
        radius = float(np.hypot(*shape.T).max())
        centre = _free_place(walls, rng, radius + _PILLAR_GAP)
        if centre is not None:
            polygons.append(centre + shape)
            walls = np.vstack([walls, _polygon_walls(polygons[-1])])
    return World.from_polygons(f"random-room-{seed}", polygons)


def random_pose(world: World, rng: np.random.Generator, clearance: float = 0.4) -> Pose:
    """Draw a pose in the free space of a room, clear of every wall.

    Parameters
    ----------
    world : walls that form closed polygons.
    rng : source of the pose; places are uniform over the free space, headings over the full turn.
    clearance : least distance to the nearest wall [m].

    Returns
    -------
    Pose, world frame, shape (3,) [m, m, rad].

    Raises
    ------
    WorldError
        No place this clear was found.
    """
    place = _free_place(world.walls, rng, clearance)
    if place is None:
        raise WorldError(f"world {world.name!r}: found no place {clearance:g} m clear of every wall")
    return pose(place[0], place[1], rng.uniform(-math.pi, math.pi))


def random_tour(world: World, rng: np.random.Generator, legs: int = 12, clearance: float = 0.5) -> Array:
    """Draw a path of straight legs through a room, each from a place to another that is in sight of it.

    Parameters
    ----------
    world : walls that form closed polygons.
    rng : source of the places; they are uniform over the free space that is in sight of the one before.
    legs : number of legs.
    clearance : least distance of a leg to the nearest wall [m].

    Returns
    -------
    Waypoints, shape (legs + 1, 2), world frame [m], each farther than a metre from the one before.

    Raises
    ------
    WorldError
        No place this clear was found.
    """
    walls = shapely.multilinestrings(list(world.walls.reshape(-1, 2, 2)))
    tour = [random_pose(world, rng, clearance)[:2]]
    for _ in range(_MAX_BATCHES * legs):
        place = random_pose(world, rng, clearance)[:2]
        leg = shapely.LineString([tour[-1], place])
        if leg.length > _LEG and leg.distance(walls) >= clearance:
            tour.append(place)
        if len(tour) > legs:
            return np.array(tour)
    raise WorldError(f"world {world.name!r}: found no path {clearance:g} m clear of every wall")


def _free_place(walls: Array, rng: np.random.Generator, clearance: float) -> Array | None:
    """Draw a place inside the polygons, shape (2,), clear of their walls [m]; None if none was found."""
    points = walls.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    for _ in range(_MAX_BATCHES):
        places = rng.uniform(low, high, (_BATCH, 2))
        inside = places[_inside(walls, places)]
        for some in np.array_split(inside, 1 + len(inside) // 4):  # the first one that is clear is enough
            free = _distances(walls, some).min(axis=1) >= clearance
            if free.any():
                return some[free.argmax()]
    return None


def _inside(walls: Array, points: Array) -> npt.NDArray[np.bool_]:
    """Whether a ray from each point towards +x crosses an odd number of walls, shape (k,)."""
    x, y = points[:, :1], points[:, 1:]
    x1, y1, x2, y2 = walls.T
    spans = (y1 > y) != (y2 > y)  # each wall without its upper end, so that a vertex counts once
    rise = np.where(y1 == y2, 1.0, y2 - y1)
    return ((spans & (x < x1 + (y - y1) / rise * (x2 - x1))).sum(axis=1) % 2).astype(bool)


def _distances(walls: Array, points: Array) -> Array:
    """Return the distance of each point to each wall, shape (k, n) [m]."""
    starts, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    offsets = points[:, None, :] - starts
    share = np.clip((offsets * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(offsets - share[..., None] * along, axis=2)


def _polygon_walls(polygon: Array) -> Array:
    """Return the walls, shape (n, 4) [m], of a closed polygon of n vertices."""
    return np.hstack([polygon, np.roll(polygon, -1, axis=0)])


def _outline(rng: np.random.Generator) -> Array:
    """Draw the vertices, shape (n, 2) [m], of an outline whose walls keep apart."""
    while True:
        outline = np.round(_draw_outline(rng), 3)
        if _keeps_apart(_polygon_walls(outline)):
            return outline


def _keeps_apart(walls: Array) -> bool:
    """Whether walls of a closed polygon that share no vertex neither cross nor come nearer than the gap."""
    index = np.arange(len(walls))
    steps = np.abs(index[:, None] - index)
    apart = (steps > 1) & (steps < len(walls) - 1)
    starts, ends = walls[:, :2], walls[:, 2:]
    nearest = np.minimum(_distances(walls, starts), _distances(walls, ends))
    along = ends - starts

    def side(points: Array) -> Array:
        """Return the signed side of wall j on which point i lies, shape (n, n)."""
        offsets = points[:, None, :] - starts
        return along[:, 0] * offsets[..., 1] - along[:, 1] * offsets[..., 0]

    parted = side(starts) * side(ends) < 0.0
    return not (apart & ((nearest < _WALL_GAP) | (parted & parted.T))).any()


def _draw_outline(rng: np.random.Generator) -> Array:
    """Draw the vertices, shape (n, 2) [m], counter-clockwise, of an outline whose walls may still cross."""
    width, height = rng.uniform(*_SIDES, 2)
    room = np.array([(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)])
    if rng.random() < 0.4:  # one wall leans in by up to 15 deg
        corner = int(rng.integers(4))
        toward = int(rng.choice([corner - 1, (corner + 1) % 4]))
        lean = math.tan(math.radians(rng.uniform(3.0, 15.0))) * min(width, height) * 0.7
        room[corner] += lean * _unit(room[toward] - room[corner])
    corners = [_corner(rng, room[k - 1], room[k], room[(k + 1) % 4]) for k in range(4)]
    outline: list[Array] = []
    for k in range(4):
        outline += corners[k]
        outline += _side(rng, corners[k][-1], corners[(k + 1) % 4][0])
    return np.array(outline)


def _corner(rng: np.random.Generator, before: Array, corner: Array, after: Array) -> list[Array]:
    """Draw the vertices of a corner of the room: unchanged, stepped in, or cut off."""
    back, on = _unit(before - corner), _unit(after - corner)
    opening = math.acos(float(back @ on))
    kind = rng.random()
    if kind < 0.25:
        a, b = rng.uniform(0.5, 1.2, 2)
        return [corner + a * back, corner + a * back + b * on, corner + b * on]
    if kind < 0.5 and opening <= math.radians(95.0):
        # The opening angles of the two new corners add up to pi + opening.
        first = rng.uniform(math.pi + opening - _WIDEST, _WIDEST)
        cut = rng.uniform(1.0, 1.8)
        a = cut * math.sin(math.pi - first)
        b = cut * math.sin(first - opening)
        return [corner + b / math.sin(opening) * back, corner + a / math.sin(opening) * on]
    return [corner]


def _side(rng: np.random.Generator, start: Array, end: Array) -> list[Array]:
    """Draw the vertices of up to two niches and cabinets along a wall, without the ends of the wall."""
    along = _unit(end - start)
    outward = np.array([along[1], -along[0]])
    length = float(np.hypot(*(end - start)))
    vertices: list[Array] = []
    at = _MARGIN
    for _ in range(int(rng.integers(0, 3))):
        at += rng.uniform(0.0, 0.5 * length)
        width = rng.uniform(*_WIDTHS)
        if at + width + _MARGIN > length:
            break
        depth = rng.uniform(*_DEPTHS) * rng.choice([-1.0, 1.0])
        leans = [abs(depth) / math.tan(math.radians(_splay(rng))) for _ in range(2)]
        # Sides that lean inwards must not make the back of the niche too narrow.
        if width + sum(leans) >= _WIDTHS[0] / 2.0:
            near, far = start + at * along, start + (at + width) * along
            vertices += [near, near - leans[0] * along + depth * outward, far + leans[1] * along + depth * outward, far]
            at += width + _MARGIN
    return vertices


def _splay(rng: np.random.Generator) -> float:
    """Draw the opening angle at the mouth of a niche or cabinet, or of a pillar [deg]."""
    return rng.uniform(*_SPLAYS) if rng.random() < 0.3 else 90.0


def _pillar_shape(rng: np.random.Generator) -> Array:
    """Draw the vertices, shape (4, 2) [m], of a rectangle or parallelogram of any orientation about the origin."""
    a, b = rng.uniform(0.4, 1.0, 2)
    opening = math.radians(_splay(rng))
    half_a, half_b = np.array([a / 2.0, 0.0]), b / 2.0 * np.array([math.cos(opening), math.sin(opening)])
    shape = np.array([-half_a - half_b, half_a - half_b, half_a + half_b, half_b - half_a])
    return shape @ rotation(rng.uniform(-math.pi, math.pi)).T


def _unit(vector: Array) -> Array:
    """Return the vector of length one in the same direction."""
    return vector / math.hypot(*vector)
