"""Noisy scans of an environment, the corners that each method extracts of them, and the true ones beside."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal

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
    environment_a,
    environment_b,
    random_pose,
    random_room,
    room,
    visible_corners,
)
from slam.study.methods import METHODS, Method

Environment = Literal["A", "B", "room", "random"]

FALSE_DISTANCE = 0.3
"""A corner farther than this from every true one is a false one [m]."""

SHOWN = 8, 0.4
"""Beams and metres [m] that each wall of a corner in the table shows; the corners of A and B are counted by these."""

CLEAR = 15, 0.5, math.radians(30.0), math.radians(150.0)
"""The same for a corner that must be found, and the opening angles of such a corner [rad]."""


class CornerSettings(BaseModel):
    """What a study of corners depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    environment: Environment = Field(description="A, B (stand-ins for the paper's), room (the demo's) or random")
    scans: int = Field(default=1000, ge=1, description="noisy scans; all methods see the same")
    sigma_range_mm: float = Field(default=20.0, gt=0.0, description="standard deviation of a range [mm]")
    sigma_bearing_deg: float = Field(
        default=round(0.391 / math.sqrt(12.0), 6), gt=0.0, description="standard deviation of a beam's direction [deg]"
    )
    rooms: int = Field(default=20, ge=1, description="random rooms; each scan is taken from a pose of its own")
    seed: int = Field(default=1, ge=0, description="of noise, rooms and poses")


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
        return np.einsum("ki,ki->k", self.errors, np.linalg.solve(self.covs, self.errors[:, :, None])[:, :, 0])


def places(settings: CornerSettings, rng: np.random.Generator) -> Iterator[tuple[int, World, Pose]]:
    """Yield the index of the world, the world and the pose of each scan."""
    if settings.environment == "random":
        rooms = [random_room(settings.rooms * settings.seed + number) for number in range(settings.rooms)]
        for scan in range(settings.scans):
            world = rooms[scan % settings.rooms]
            yield scan % settings.rooms, world, random_pose(world, rng)
        return
    world, sensor = {
        "A": (environment_a, ENVIRONMENT_A_POSE),
        "B": (environment_b, ENVIRONMENT_B_POSE),
        "room": (room, ROOM_POSE),
    }[settings.environment]
    shown = world()
    for _ in range(settings.scans):
        yield 0, shown, sensor


ROOM_POSE = pose(2.5, 2.0, 0.3)
"""Where the sensor stands in the demo's room, world frame [m, m, rad]."""


def scan_corners(
    settings: CornerSettings,
    progress: Callable[[float, int], None] = lambda share, scans: None,
    methods: tuple[Method, ...] = METHODS,
) -> tuple[list[Seen], dict[str, Found]]:
    """Take noisy scans and extract their corners by each method.

    Parameters
    ----------
    settings : environment, noise, number of scans, seed.
    progress : is told the share that is done, 0 to 1, and the number of scans.
    methods : all on the same scans.

    Returns
    -------
    The worlds, and by key of each method what it found.
    """
    placing, noise = (np.random.default_rng(child) for child in np.random.SeedSequence(settings.seed).spawn(2))
    model = dataclasses.replace(
        sensor_preset("rplidar-s1"),
        sigma_range=settings.sigma_range_mm * 1e-3,
        sigma_bearing=math.radians(settings.sigma_bearing_deg),
    )
    lidar = dataclasses.replace(
        Lidar.of_preset("rplidar-s1"), sigma_range=model.sigma_range, sigma_bearing=model.sigma_bearing
    )
    configs = {method.key: method.extraction for method in methods}
    tallies: dict[int, _Tally] = {}
    lots: dict[str, list[tuple[int, int, NDArray[np.int64], Array, Array, NDArray[np.bool_]]]]
    lots = {method.key: [] for method in methods}
    visible: tuple[World, Pose, NDArray[np.bool_]] | None = None
    for number, (index, world, sensor) in enumerate(places(settings, placing)):
        tally = tallies.setdefault(index, _Tally(world))
        # From one pose every scan shows the same.
        if visible is None or visible[0] is not world or visible[1] is not sensor:
            visible = world, sensor, tally.look(sensor)
        clear = visible[2]
        tally.count()
        scan = lidar.scan(world, sensor, 0.0, noise)
        truth = transform(inverse(sensor), world.corners)
        for key, config in configs.items():
            corners = extract(scan, model, config).corners
            apart = corners.positions[:, None] - truth
            nearest = (apart**2).sum(axis=2).argmin(axis=1)
            errors = apart[np.arange(len(nearest)), nearest]
            lots[key].append((number, index, nearest, errors, corners.covs, clear[nearest]))
        progress((number + 1) / settings.scans, number + 1)
    return [tallies[index].seen() for index in sorted(tallies)], {key: _found(lot) for key, lot in lots.items()}


class _Tally:
    """Counts the scans that show each corner of a world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._order: list[int] = []
        self._shown = np.zeros(len(world.corners), dtype=np.int64)
        self._clear = np.zeros(len(world.corners), dtype=np.int64)
        self._now: tuple[NDArray[np.int64], NDArray[np.bool_]] = np.empty(0, np.int64), np.empty(0, np.bool_)

    def look(self, sensor: Pose) -> NDArray[np.bool_]:
        """Whether a scan from a pose shows each corner clearly, shape (k,)."""
        shown = visible_corners(self._world, sensor, *SHOWN)
        clear = np.zeros(len(self._world.corners), dtype=np.bool_)
        clear[visible_corners(self._world, sensor, *CLEAR[:2])] = True
        clear &= (self._world.opening_angles >= CLEAR[2]) & (self._world.opening_angles <= CLEAR[3])
        self._order += [corner for corner in shown.tolist() if corner not in self._order]
        self._now = shown, clear
        return clear

    def count(self) -> None:
        """Count a scan from the pose looked from last."""
        shown, clear = self._now
        self._shown[shown] += 1
        self._clear += clear

    def seen(self) -> Seen:
        """Return what was counted."""
        world = self._world
        order = np.array(self._order, dtype=np.int64)
        return Seen(world.name, world.corners, world.opening_angles, order, self._shown, self._clear)


def _found(lot: list[tuple[int, int, NDArray[np.int64], Array, Array, NDArray[np.bool_]]]) -> Found:
    counts = [len(nearest) for _, _, nearest, _, _, _ in lot]
    scans, worlds, corners, errors, covs, clear = zip(*lot, strict=True)
    return Found(
        scans=np.repeat(np.array(scans), counts),
        worlds=np.repeat(np.array(worlds), counts),
        corners=np.concatenate(corners),
        errors=np.concatenate(errors),
        covs=np.concatenate(covs),
        clear=np.concatenate(clear),
    )
