"""Noisy scans of an environment, the corners that each method extracts of them, and the true ones beside."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from features import extract, sensor_preset
from features.se2 import Array, Pose, inverse, pose, transform
from sim import (
    ENVIRONMENT_A_POSE,
    ENVIRONMENT_B_POSE,
    Lidar,
    World,
    cluttered_room,
    effects_of,
    environment_a,
    environment_b,
    random_pose,
    random_room,
    room,
    visible_corners,
)
from slam.evaluation.metrics import nees
from slam.study.paper.methods import GATE_99, METHODS, PAPER_AND_DEFAULT, Method

Environment = Literal["A", "B", "room", "random", "cluttered"]

DRAWN: Mapping[str, tuple[Callable[[int], World], int]] = {
    "random": (random_room, 20),
    "cluttered": (cluttered_room, 40),
}
"""Environments of rooms that are drawn at random, and how many are drawn by default."""

FALSE_DISTANCE = 0.3
"""A corner farther than this from every true one is a false one in the tables of the paper [m]."""

PHANTOM_DISTANCE = 0.2
"""A corner farther than this from every true one is a phantom [m]."""

FOUND_DISTANCE = 0.1
"""A clear corner is found if a reported one is nearer than this [m], or holds it in its 99 % gate."""

SHOWN = 8, 0.4
"""Beams and metres [m] that each wall of a corner in the table shows; the corners of A and B are counted by these."""

CLEAR = 15, 0.5, math.radians(30.0), math.radians(150.0)
"""The same for a corner that must be found, and the opening angles of such a corner [rad]."""


class CornerSettings(BaseModel):
    """What a study of corners depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    environment: Environment = Field(
        description="A, B (stand-ins for the paper's), room (the demo's), random or cluttered (rooms drawn at random)"
    )
    scans: int = Field(default=1000, ge=1, description="noisy scans; all methods see the same")
    sensor: str = Field(default="rplidar-s1", description="preset of the scanner")
    effects: str = Field(default="off", description="what the scanner does beside: on, off, or those of a named one")
    sigma_range_mm: float = Field(
        default_factory=lambda given: round(sensor_preset(given["sensor"]).sigma_range * 1e3, 6),
        gt=0.0,
        description="standard deviation of a range, by default as the preset [mm]",
    )
    sigma_bearing_deg: float = Field(
        default_factory=lambda given: round(math.degrees(sensor_preset(given["sensor"]).sigma_bearing), 6),
        gt=0.0,
        description="standard deviation of a beam's direction, by default as the preset [deg]",
    )
    rooms: int = Field(
        default_factory=lambda given: DRAWN[given["environment"]][1] if given["environment"] in DRAWN else 1,
        ge=1,
        description="rooms that are drawn; each scan is taken from a pose of its own",
    )
    seed: int = Field(default=1, ge=0, description="of noise, rooms and poses")

    @property
    def methods(self) -> tuple[Method, ...]:
        """Methods that extract the corners."""
        return PAPER_AND_DEFAULT if self.environment == "cluttered" else METHODS


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """True corners of one world that scans were taken of.

    Parameters
    ----------
    name : of the world.
    positions : of all corners, world frame, shape (k, 2) [m].
    opening_angles : shape (k,) [rad].
    order : corners that a scan shows, clockwise as in the paper's tables, shape (c,).
    shown, clear : scans that show each corner by :data:`SHOWN` and by :data:`CLEAR`, shape (k,).
    """

    name: str
    positions: Array
    opening_angles: Array
    order: NDArray[np.int64]
    shown: NDArray[np.int64]
    clear: NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Corners that one method extracted of all scans, each beside the nearest true one, sensor frame.

    Parameters
    ----------
    scans, worlds, corners : scan, index of its world and true corner, shape (m,).
    errors : position less the true one, shape (m, 2) [m].
    covs : claimed, shape (m, 2, 2) [m^2].
    clear : whether the scan shows the true corner by :data:`CLEAR`, shape (m,).
    """

    scans: NDArray[np.int64]
    worlds: NDArray[np.int64]
    corners: NDArray[np.int64]
    errors: Array
    covs: Array
    clear: NDArray[np.bool_]

    @property
    def false(self) -> NDArray[np.bool_]:
        """Whether a corner is farther than :data:`FALSE_DISTANCE` from every true one, shape (m,)."""
        return np.hypot(*self.errors.T) > FALSE_DISTANCE

    @property
    def nees(self) -> Array:
        """Squared Mahalanobis distance of each corner from the true one, shape (m,)."""
        return nees(self.errors, self.covs)


@functools.cache
def studied_world(environment: Environment, seed: int) -> World:
    """Make a world that scans are taken of; of those that are drawn, the one of a seed."""
    if environment in DRAWN:
        return DRAWN[environment][0](seed)
    return {"A": environment_a, "B": environment_b, "room": room}[environment]()


def _world(settings: CornerSettings, index: int) -> World:
    return studied_world(settings.environment, settings.rooms * settings.seed + index)


PLACES: Mapping[str, Pose] = {"A": ENVIRONMENT_A_POSE, "B": ENVIRONMENT_B_POSE, "room": pose(2.5, 2.0, 0.3)}
"""Pose of the sensor in each environment but those drawn at random, world frame [m, m, rad]."""

SCANS_OF_TASK = 50
"""Scans that one task takes; the noise of each task is its own."""


def task_count(settings: CornerSettings) -> int:
    """Count the tasks of a study."""
    return math.ceil(settings.scans / SCANS_OF_TASK)


def scan_task(settings: CornerSettings, task: int, seed: int) -> dict[str, Any]:
    """Take the noisy scans of a task and extract their corners by each method.

    Parameters
    ----------
    settings : environment and noise.
    task : its number, which says which scans.
    seed : of noise and poses.

    Returns
    -------
    ``seen``: fields of :class:`Seen` that are counted, by index of the world; ``found``: fields of :class:`Found` by
    key of the method; ``clear_found``: clear corners that each method found; all as lists.
    """
    placing, noise = (np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(2))
    sigmas = {"sigma_range": settings.sigma_range_mm * 1e-3, "sigma_bearing": math.radians(settings.sigma_bearing_deg)}
    model = dataclasses.replace(sensor_preset(settings.sensor), **sigmas)
    effects = effects_of(settings.effects, settings.sensor)
    lidar = dataclasses.replace(Lidar.of_preset(settings.sensor, effects=effects), **sigmas)
    tallies: dict[int, _Tally] = {}
    lots: dict[str, list[Found]] = {method.key: [] for method in settings.methods}
    clear_found = dict.fromkeys(lots, 0)
    for number in range(task * SCANS_OF_TASK, min((task + 1) * SCANS_OF_TASK, settings.scans)):
        index = number % settings.rooms
        world = _world(settings, index)
        sensor = PLACES.get(settings.environment)
        if sensor is None:
            sensor = random_pose(world, placing)
        clear = tallies.setdefault(index, _Tally(world, lidar.angles)).count(sensor)
        scan = lidar.scan(world, sensor, 0.0, noise)
        truth = transform(inverse(sensor), world.corners)
        for method in settings.methods:
            corners = extract(scan, model, method.extraction).corners
            apart = corners.positions[:, None] - truth
            nearest = (apart**2).sum(axis=2).argmin(axis=1)
            clear_found[method.key] += _count_found(apart[:, clear], corners.covs)
            lots[method.key].append(
                Found(
                    scans=np.full(len(nearest), number),
                    worlds=np.full(len(nearest), index),
                    corners=nearest,
                    errors=apart[np.arange(len(nearest)), nearest],
                    covs=corners.covs,
                    clear=clear[nearest],
                )
            )
    return {
        "seen": [[index, tallies[index].lists()] for index in sorted(tallies)],
        "found": {
            key: {field.name: _joined(lot, field.name).tolist() for field in dataclasses.fields(Found)}
            for key, lot in lots.items()
        },
        "clear_found": clear_found,
    }


def _count_found(apart: Array, covs: Array) -> int:
    """Count the true corners, of k, that any of m reported ones is near or holds in its gate, shape (m, k, 2) [m]."""
    near = np.hypot(apart[..., 0], apart[..., 1]) <= FOUND_DISTANCE
    held = nees(apart.reshape(-1, 2), np.repeat(covs, apart.shape[1], axis=0)).reshape(near.shape) <= GATE_99
    return int((near | held).any(axis=0).sum())


def collect_results(
    settings: CornerSettings, results: Sequence[Mapping[str, Any]]
) -> tuple[list[Seen], dict[str, Found], dict[str, int]]:
    """Put together what the tasks of :func:`scan_task` yielded, in the order of their numbers.

    Returns
    -------
    The worlds, and by key of each method what it reported and how many clear corners it found.
    """
    parts: dict[int, list[Mapping[str, list[int]]]] = {}
    for result in results:
        for index, lists in result["seen"]:
            parts.setdefault(index, []).append(lists)
    seen: list[Seen] = []
    for index, of in sorted(parts.items()):
        world = _world(settings, index)
        order = dict.fromkeys(corner for lists in of for corner in lists["order"])
        counts = (np.sum([lists[name] for lists in of], axis=0) for name in ("shown", "clear"))
        seen.append(Seen(world.name, world.corners, world.opening_angles, np.array([*order], np.int64), *counts))
    keys = [method.key for method in settings.methods]
    lots = {key: [_found(result["found"][key]) for result in results] for key in keys}
    found = {
        key: Found(**{field.name: _joined(lot, field.name) for field in dataclasses.fields(Found)})
        for key, lot in lots.items()
    }
    return seen, found, {key: sum(result["clear_found"][key] for result in results) for key in keys}


def _found(lists: Mapping[str, list[Any]]) -> Found:
    return Found(
        scans=np.array(lists["scans"], np.int64),
        worlds=np.array(lists["worlds"], np.int64),
        corners=np.array(lists["corners"], np.int64),
        errors=np.array(lists["errors"], np.float64).reshape(-1, 2),
        covs=np.array(lists["covs"], np.float64).reshape(-1, 2, 2),
        clear=np.array(lists["clear"], np.bool_),
    )


def _joined(lot: Sequence[Found], name: str) -> NDArray[Any]:
    return np.concatenate([getattr(found, name) for found in lot])


class _Tally:
    """Counts the scans that show each corner of a world, by the directions of their beams [rad]."""

    def __init__(self, world: World, angles: Array) -> None:
        self._world = world
        self._angles = angles
        self._order: dict[int, None] = {}
        self._shown = np.zeros(len(world.corners), dtype=np.int64)
        self._clear = np.zeros(len(world.corners), dtype=np.int64)
        self._place: Pose | None = None
        self._now: tuple[NDArray[np.int64], NDArray[np.bool_]] = np.empty(0, np.int64), np.empty(0, np.bool_)

    def count(self, sensor: Pose) -> NDArray[np.bool_]:
        """Count a scan from a pose; return whether it shows each corner clearly, shape (k,)."""
        if self._place is not sensor:  # from one pose every scan shows the same
            self._place, self._now = sensor, self._look(sensor)
            self._order |= dict.fromkeys(self._now[0].tolist())
        shown, clear = self._now
        self._shown[shown] += 1
        self._clear += clear
        return clear

    def _look(self, sensor: Pose) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        clear = np.zeros(len(self._world.corners), dtype=np.bool_)
        clear[visible_corners(self._world, sensor, *CLEAR[:2], self._angles)] = True
        clear &= (self._world.opening_angles >= CLEAR[2]) & (self._world.opening_angles <= CLEAR[3])
        return visible_corners(self._world, sensor, *SHOWN, self._angles), clear

    def lists(self) -> dict[str, list[int]]:
        """Return what was counted, by the fields of :class:`Seen`."""
        return {"order": [*self._order], "shown": self._shown.tolist(), "clear": self._clear.tolist()}
