"""Buildings: a corridor, an apartment, and two office floors, each with a path through it."""

import numpy as np
from shapely import Polygon, box

from features.se2 import Array
from sim.worlds.floor_plan import floor_plan
from sim.worlds.site import Site

_DOOR = 0.9
"""Width of a doorway, as is usual indoors [m]."""

_NICHE = 0.35
"""Depth of the niche of a closed door [m]: a thick wall, so that both edges of the niche show in a scan."""

_STEP = 0.2
"""Waypoints are farther apart than this, and so than the reach of a robot, 0.15 m [m]."""


def corridor() -> Site:
    """Make a corridor of 30 m by 2.2 m with closed doors in niches and a wider end; the path goes there and back."""
    below, above = (2.6, 9.1, 12.3, 19.8, 25.4), (4.0, 7.2, 14.9, 22.1)
    free = [
        box(0.0, 0.0, 30.0, 2.2),
        box(28.2, 2.2, 30.0, 3.6),
        *(box(x, -_NICHE, x + _DOOR, 0.0) for x in below),
        *(box(x, 2.2, x + _DOOR, 2.2 + _NICHE) for x in above),
    ]
    solid = [box(16.5, 1.75, 18.3, 2.2), box(6.0, 0.0, 6.4, 0.4)]
    waypoints = [(0.8, 1.0), (15.0, 1.1), (17.5, 0.85), (20.0, 1.1), (28.9, 1.2), (29.1, 2.6), (28.6, 1.1)]
    back = [(20.0, 1.1), (17.5, 0.85), (15.0, 1.1), (1.2, 1.1)]
    return Site.of(floor_plan("corridor", free, solid), [*waypoints, *back])


def apartment() -> Site:
    """Make an apartment of 11 m by 8.7 m: six furnished rooms around a hall; the path enters all of them."""
    living, kitchen, bath = box(0.0, 0.0, 5.5, 4.4), box(5.62, 0.0, 8.6, 3.0), box(8.72, 0.0, 11.0, 3.0)
    hall = box(5.62, 3.12, 11.0, 4.4)
    bedroom, nursery, study = box(0.0, 4.52, 4.0, 8.5), box(4.12, 4.52, 7.6, 8.5), box(7.72, 4.52, 11.0, 8.5)
    doorways = [
        box(5.5, 3.3, 5.62, 4.2),
        box(6.5, 3.0, 7.4, 3.12),
        box(9.4, 3.0, 10.3, 3.12),
        box(6.2, 4.4, 7.1, 4.52),
        box(9.0, 4.4, 9.9, 4.52),
        box(2.6, 4.4, 3.5, 4.52),
    ]
    entrance, windows = box(11.0, 3.3, 11.2, 4.2), [box(1.6, -0.2, 3.6, 0.0), box(1.2, 8.5, 2.4, 8.7)]
    furniture = [
        box(0.0, 1.0, 0.95, 3.2),  # sofa
        box(1.75, 1.7, 2.4, 2.8),  # its table
        Polygon([(4.2, 0.9), (5.0, 1.4), (4.6, 2.04), (3.8, 1.54)]),  # table
        box(0.3, 4.05, 1.7, 4.4),  # shelf
        box(5.62, 0.0, 6.22, 2.3),  # kitchen counters
        box(6.22, 0.0, 8.6, 0.6),
        box(10.2, 0.0, 11.0, 1.7),  # tub
        box(8.72, 0.9, 9.15, 1.6),  # basin
        box(0.0, 5.5, 2.0, 7.2),  # bed
        box(2.9, 7.9, 4.0, 8.5),  # wardrobe
        box(4.12, 6.5, 5.1, 8.5),  # bed
        box(6.9, 6.6, 7.6, 7.9),  # desk
        box(7.72, 5.6, 8.1, 7.6),  # shelf
        box(9.5, 7.75, 11.0, 8.5),  # desk
        Polygon([(9.9, 6.5), (10.35, 6.35), (10.5, 6.8), (10.05, 6.95)]),  # armchair
    ]
    waypoints = [
        *[(1.3, 0.55), (3.1, 0.7), (3.05, 3.2), (3.05, 5.2), (2.6, 7.55), (1.0, 7.9), (2.5, 7.6), (3.05, 5.2)],
        *[(3.05, 3.8), (4.6, 3.75), (6.4, 3.75), (6.65, 5.2), (6.0, 6.2), (6.0, 7.6), (6.0, 6.2), (6.65, 5.2)],
        *[(6.95, 3.75), (6.95, 2.2), (7.8, 1.3), (6.95, 2.2), (7.2, 3.75), (9.1, 3.75), (9.45, 5.2), (8.9, 7.8)],
        *[(9.45, 5.4), (10.4, 5.5), (9.45, 5.0), (9.75, 3.75), (9.75, 2.2), (9.65, 0.7), (9.85, 2.2), (9.75, 3.75)],
        *[(6.3, 3.75), (4.6, 3.7), (3.05, 3.3), (1.7, 3.6), (1.4, 2.9), (1.35, 0.7)],
    ]
    rooms = [living, kitchen, bath, hall, bedroom, nursery, study]
    return Site.of(floor_plan("apartment", [*rooms, *doorways, entrance, *windows], furniture), waypoints)


def office_loop() -> Site:
    """Make an office floor of 64 m by 32 m: corridors of 2 m that form two loops, with closed doors in niches.

    The path goes round the left loop, round the right one, and round both, 430 m in all: every place is visited again.
    """
    rng = np.random.default_rng(1)
    width, height, wide = 64.0, 32.0, 2.0
    middle = width / 2.0
    free = [
        *(box(0.0, y, width, y + wide) for y in (0.0, height - wide)),
        *(box(x, 0.0, x + wide, height) for x in (0.0, middle - wide / 2.0, width - wide)),
    ]
    for outer, inner in ((0.0, wide), (height, height - wide)):
        out = 1.0 if outer > inner else -1.0
        free += [_niche_along_x(x, outer, out) for x in _spread(rng, 1.0, width - 1.0)]
        for start, end in ((wide, middle - wide / 2.0), (middle + wide / 2.0, width - wide)):
            free += [_niche_along_x(x, inner, -out) for x in _spread(rng, start + 0.6, end - 0.6)]
    for x, out in ((0.0, -1.0), (wide, 1.0), (width, 1.0), (width - wide, -1.0)):
        free += [_niche_along_y(x, y, out) for y in _spread(rng, wide + 0.6, height - wide - 0.6)]
    for out in (-1.0, 1.0):
        free += [
            _niche_along_y(middle + out * wide / 2.0, y, out) for y in _spread(rng, wide + 0.6, height - wide - 0.6)
        ]
    left, right = 1.0, width - 1.0
    low, high = 1.0, height - 1.0
    waypoints = [
        *[(left, low), (middle, low), (middle, high), (left, high), (left, low)],
        *[(middle, low), (right, low), (right, high), (middle, high), (middle, low)],
        *[(right, low), (right, high), (left, high), (left, low + 0.5)],
    ]
    return Site.of(floor_plan("office-loop", free), waypoints)


def large_office() -> Site:
    """Make an office floor of 61 m by 38 m: 72 furnished rooms on three corridors, more than 1,000 walls.

    The corridors are joined at both ends and in the middle; the path enters every room.
    """
    rng = np.random.default_rng(2)
    wall, wide, deep, block = 0.15, 2.0, 5.0, 27.4
    starts = (wide + wall, 2.0 * wide + 3.0 * wall + block)
    width = starts[1] + block + wall + wide
    lows = [deep + wall + row * (wide + 2.0 * deep + 3.0 * wall) for row in range(3)]
    solid: list[Polygon] = []
    waypoints: list[tuple[float, float]] = []
    free = [box(x, lows[0], x + wide, lows[-1] + wide) for x in (0.0, starts[0] + block + wall, width - wide)]
    for row, low in enumerate(lows):
        free.append(box(0.0, low, width, low + wide))
        centre = low + wide / 2.0
        stops: list[tuple[float, float, float]] = []
        for side in (-1.0, 1.0):
            near = centre + side * (wide / 2.0 + wall)
            for start in starts:
                for left, right in _rooms(rng, start, block, wall):
                    free.append(_box(left, near, right, near + side * deep))
                    door = rng.uniform(left + 0.4, right - 0.4 - _DOOR)
                    free.append(_box(door, near - side * wall, door + _DOOR, near))
                    solid += _furniture(rng, left, right, near, side * deep)
                    stops.append((door + _DOOR / 2.0, near - side * wall / 2.0, near + side * 1.0))
        back = row % 2 == 1
        ends = [(wide / 2.0, centre), (width - wide / 2.0, centre)]
        visits = [(x, y) for x, door, room in sorted(stops, reverse=back) for y in (centre, door, room, door, centre)]
        waypoints += [ends[back], *visits, ends[not back]]
    return Site.of(floor_plan("large-office", free, solid), _apart(waypoints))


def _rooms(rng: np.random.Generator, start: float, length: float, wall: float) -> list[tuple[float, float]]:
    """Draw the left and right sides [m] of six rooms of uneven width that fill a length, with walls between them."""
    shares = rng.uniform(0.8, 1.2, 6)
    widths = shares / shares.sum() * (length - 5.0 * wall)
    lefts = start + np.concatenate([[0.0], np.cumsum(widths + wall)[:-1]])
    return [(float(left), float(left + width)) for left, width in zip(lefts, widths, strict=True)]


def _furniture(rng: np.random.Generator, left: float, right: float, near: float, deep: float) -> list[Polygon]:
    """Draw a free-standing desk and a cabinet at the far wall of a room, clear of the door."""
    side = 1.0 if deep > 0.0 else -1.0
    far = near + deep
    desk, desk_y = rng.uniform(left + 0.5, right - 2.0), far - side * rng.uniform(1.5, 1.8)
    cabinet = rng.uniform(left + 0.3, right - 1.5)
    return [
        _box(desk, desk_y, desk + 1.5, desk_y - side * 0.75),
        _box(cabinet, far, cabinet + 1.2, far - side * 0.45),
    ]


def _spread(rng: np.random.Generator, start: float, end: float) -> list[float]:
    """Draw the places of doors between two ends [m], 2.5 m to 5.5 m apart, so that no two stretches look alike."""
    at = start + rng.uniform(0.0, 2.0)
    places: list[float] = []
    while at + _DOOR <= end:
        places.append(at)
        at += rng.uniform(2.5, 5.5)
    return places


def _niche_along_x(x: float, y: float, out: float) -> Polygon:
    return _box(x, y, x + _DOOR, y + out * _NICHE)


def _niche_along_y(x: float, y: float, out: float) -> Polygon:
    return _box(x, y, x + out * _NICHE, y + _DOOR)


def _box(x1: float, y1: float, x2: float, y2: float) -> Polygon:
    """Make a rectangle from two opposite corners in any order."""
    return box(min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2))


def _apart(waypoints: list[tuple[float, float]]) -> Array:
    """Leave out waypoints that are no farther than :data:`_STEP` from the one before."""
    kept = waypoints[:1]
    for point in waypoints[1:]:
        if np.hypot(point[0] - kept[-1][0], point[1] - kept[-1][1]) > _STEP:
            kept.append(point)
    return np.array(kept)
