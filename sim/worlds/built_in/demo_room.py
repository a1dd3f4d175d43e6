"""The room of the demo, and a path through it."""

import math

import numpy as np

from features.se2 import Array
from sim.worlds.world import World

_SLOPE = 1.8 / math.tan(math.radians(40.0))
"""Length of the oblique wall of the room, projected on the north wall [m]; it and the east wall form 130 deg."""

_OUTLINE = [
    (0.0, 0.0),
    (4.0, 0.0),
    (4.0, 0.7),
    (5.6, 0.7),
    (5.6, 0.0),
    (10.0, 0.0),
    (10.0, 2.8),
    (9.2, 2.8),
    (9.2, 4.4),
    (10.0, 4.4),
    (10.0, 6.2),
    (10.0 - _SLOPE, 8.0),
    (4.8, 8.0),
    (4.8, 7.2),
    (2.6, 7.2),
    (2.6, 8.0),
    (0.0, 8.0),
    (0.0, 4.9),
    (0.7, 4.9),
    (0.7, 3.1),
    (0.0, 3.1),
]

_PILLAR = [(3.0, 2.8), (3.8, 2.8), (3.8, 3.6), (3.0, 3.6)]
_CABINET = [(5.4, 3.2), (7.0, 3.2), (7.0, 4.0), (5.4, 4.0)]
_TURNED_BOX = [(4.0, 4.7), (4.7, 4.3), (5.1, 5.0), (4.4, 5.4)]

_ROUND = [
    (2.2, 1.7),
    (4.8, 1.5),
    (7.4, 1.8),
    (8.1, 3.6),
    (7.7, 5.4),
    (6.2, 6.3),
    (3.7, 6.3),
    (1.7, 5.8),
    (1.6, 4.0),
]


def room() -> World:
    """Make a room of 10 m by 8 m: alcoves, an oblique wall, and a free-standing pillar, cabinet and box."""
    return World.from_polygons("room", [_OUTLINE, _PILLAR, _CABINET, _TURNED_BOX])


def room_waypoints(rounds: int = 2) -> Array:
    """Return a closed path through :func:`room`, counter-clockwise, more than half a metre from every wall.

    Parameters
    ----------
    rounds : number of rounds, of about 19 m each.

    Returns
    -------
    Waypoints, shape (9 rounds + 1, 2), world frame [m]; the last is the first.

    Raises
    ------
    ValueError
        ``rounds`` is less than one.
    """
    if rounds < 1:
        raise ValueError(f"rounds is {rounds}: expected at least 1")
    return np.array(_ROUND * rounds + _ROUND[:1])
