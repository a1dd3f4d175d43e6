"""A 2D laser scanner and the noise of its beams."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

import numpy as np

from features.scan import LaserScan
from features.se2 import Array, Pose, pose
from features.sensor import Mounting, sensor_preset
from sim.world import World

_BEAMS: Mapping[str, tuple[Array, float]] = MappingProxyType(
    {
        "rplidar-s1": (np.asarray(-math.pi + 2.0 * math.pi * np.arange(920) / 920.0, dtype=np.float64), 10.0),
        "sick-lms": (np.asarray(np.radians(np.arange(-90.0, 90.0)), dtype=np.float64), 5.0),
    }
)
"""Angles [rad] and rate [Hz] of each preset that can be simulated."""


@dataclass(frozen=True, slots=True, eq=False)
class Lidar:
    """A scanner that takes all beams of a scan at one instant.

    Parameters
    ----------
    angles : nominal direction of each beam, sensor frame, shape (n,) [rad].
    sigma_range : standard deviation of a range [m].
    sigma_bearing : standard deviation of the direction of a beam [rad].
    range_min, range_max : a measured range outside of them is no return [m].
    rate : scans per second [Hz].
    mounting : where the sensor sits on the robot.

    Raises
    ------
    ValueError
        A sigma is negative, the rate is not positive, or the limits are not 0 <= range_min < range_max.
    """

    angles: Array
    sigma_range: float
    sigma_bearing: float
    range_min: float
    range_max: float
    rate: float
    mounting: Mounting = field(default_factory=Mounting)

    def __post_init__(self) -> None:
        for name in ("sigma_range", "sigma_bearing"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value:g}: a standard deviation must be finite and not negative")
        if not (math.isfinite(self.rate) and self.rate > 0.0):
            raise ValueError(f"rate is {self.rate:g}: expected scans per second")
        if not 0.0 <= self.range_min < self.range_max:
            raise ValueError(
                f"range_min {self.range_min:g}, range_max {self.range_max:g}: expected 0 <= range_min < range_max"
            )

    @classmethod
    def of_preset(cls, name: str, mounting: Mounting | None = None) -> Self:
        """Scanner with the beams, the noise and the limits of a known sensor.

        Parameters
        ----------
        name : ``rplidar-s1`` (920 beams over the full turn, 10 Hz) or ``sick-lms`` (180 beams from
            -90 deg by 1 deg, 5 Hz).
        mounting : where the sensor sits on the robot; by default at its origin, looking ahead.

        Raises
        ------
        ValueError
            No preset has this name, or its beams are not known here.
        """
        model = sensor_preset(name)
        if name not in _BEAMS:
            raise ValueError(
                f"the beams of sensor preset {name!r} are not known: known are {', '.join(sorted(_BEAMS))}"
            )
        angles, rate = _BEAMS[name]
        return cls(
            angles=angles.copy(),
            sigma_range=model.sigma_range,
            sigma_bearing=model.sigma_bearing,
            range_min=model.range_min,
            range_max=model.range_max,
            rate=rate,
            mounting=mounting if mounting is not None else Mounting(),
        )

    def scan(self, world: World, pose_world_robot: Pose, stamp: float, rng: np.random.Generator) -> LaserScan:
        """Measure the world from a pose, with the noise of section III of the paper.

        The direction of each beam is disturbed before the ray is cast, its range after; the angle reported is the
        nominal one.

        Parameters
        ----------
        world : the walls.
        pose_world_robot : pose of the robot, shape (3,) [m, m, rad].
        stamp : time of the scan [s].
        rng : source of the noise.

        Returns
        -------
        Scan in the sensor frame; a range outside the limits, and a beam that hits nothing, is inf.
        """
        x, y, heading = pose_world_robot
        mounting = self.mounting
        c, s = math.cos(heading), math.sin(heading)
        origin = pose(x + c * mounting.x - s * mounting.y, y + s * mounting.x + c * mounting.y)
        turning = -1.0 if mounting.upside_down else 1.0
        directions = self.angles + self.sigma_bearing * rng.standard_normal(self.angles.size)
        ranges, _ = world.cast(origin, heading + mounting.theta + turning * directions)
        ranges += self.sigma_range * rng.standard_normal(ranges.size)
        ranges[(ranges < self.range_min) | (ranges > self.range_max)] = np.inf
        return LaserScan(ranges=ranges, angles=self.angles, stamp=stamp)
