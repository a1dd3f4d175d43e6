"""The catalogue of worlds: built-in worlds by name and worlds from files, each as a site."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from sim.errors import WorldError
from sim.worlds.built_in.buildings import apartment, corridor, large_office, office_loop
from sim.worlds.built_in.cluttered_rooms import cluttered_room
from sim.worlds.built_in.demo_room import room, room_waypoints
from sim.worlds.built_in.paper import environment_a, environment_b
from sim.worlds.built_in.random_rooms import random_room, random_tour
from sim.worlds.formats.world_file import read_site
from sim.worlds.site import Site
from sim.worlds.world import World

_PATH_A = [
    *[(4.4, 3.9), (5.7, 2.9), (7.0, 2.4), (8.2, 3.6), (7.4, 5.2), (5.8, 5.0), (5.6, 6.4), (4.5, 7.2), (3.4, 6.4)],
    *[(2.2, 5.2), (0.9, 4.5), (0.8, 3.4), (1.8, 2.5), (2.9, 1.6), (4.2, 2.9), (4.4, 3.7)],
]
_PATH_B = [
    *[(1.8, 2.8), (2.5, 1.9), (2.55, 0.9), (1.8, 0.45), (1.15, 0.7), (1.05, 1.9), (1.0, 3.0), (1.2, 4.7), (1.7, 5.3)],
    *[(1.8, 4.2), (2.8, 2.7), (1.9, 2.6)],
]

BUILT_IN: Mapping[str, Callable[[], Site]] = MappingProxyType(
    {
        "room": lambda: Site.of(room(), room_waypoints()),
        "environment-a": lambda: Site.of(environment_a(), _PATH_A),
        "environment-b": lambda: Site.of(environment_b(), _PATH_B),
        "corridor": corridor,
        "apartment": apartment,
        "office-loop": office_loop,
        "large-office": large_office,
    }
)
"""Built-in worlds by name; :func:`find_site` knows those of :data:`DRAWN`, one for each seed, besides."""

DRAWN: Mapping[str, Callable[[int], World]] = MappingProxyType(
    {"random-room": random_room, "cluttered-room": cluttered_room}
)
"""Rooms that are drawn at random, by the name that comes before ``-SEED``."""


def find_site(name: str) -> Site:
    """Make a built-in world or read one from a file.

    Parameters
    ----------
    name : name of a built-in world, or path of a file; the name takes precedence.

    Raises
    ------
    WorldError
        No built-in world and no file has this name, or the file cannot be read.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]()
    if (drawn := re.fullmatch(r"([a-z-]+)-(\d{1,18})", name)) and drawn[1] in DRAWN:
        seed = int(drawn[2])
        world = DRAWN[drawn[1]](seed)
        return Site.of(world, random_tour(world, np.random.default_rng(seed)))
    if not Path(name).exists():
        raise WorldError(
            f"no world and no file {name!r}: built in are {', '.join(BUILT_IN)}, random-room-SEED and "
            "cluttered-room-SEED, such as random-room-1"
        )
    return read_site(Path(name))
