"""A 2D laser scanner and the noise of its beams."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Self

import numpy as np
import numpy.typing as npt

from features.scan import LaserScan
from features.se2 import Array, Pose
from features.sensor import Mounting, sensor_preset
from sim.motion.person import Person
from sim.sensing.beam_hits import Hits, cast_beams_at, cos_incidence, mix_edges
from sim.sensing.effects import Effects, round_to_step
from sim.worlds.world import World


def _full_turn(beams: int) -> Array:
    return -math.pi + 2.0 * math.pi * np.arange(beams) / beams


_BEAMS: Mapping[str, tuple[Array, float]] = MappingProxyType(
    {
        "rplidar-s1": (_full_turn(920), 10.0),
        "rplidar-a1": (_full_turn(800), 10.0),
        "rplidar-a2": (_full_turn(800), 10.0),
        "rplidar-a3": (_full_turn(1600), 10.0),
        "rplidar-s2": (_full_turn(3200), 10.0),
        "sick-lms": (np.asarray(np.radians(np.arange(-90.0, 90.0)), dtype=np.float64), 5.0),
    }
)
"""Angles [rad] and rate [Hz] of each preset of a laser scanner.

By their data sheets an S1 takes 9,200 samples per second, A1 and A2 8,000, an A3 16,000 and an S2 32,000, all at 10
turns per second. An LMS scans faster than its serial line carries: at 19,200 baud 180 ranges take a fifth of a second.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """A scan and the truth about each of its beams, lost ones too; shape (n,) each.

    Parameters
    ----------
    scan : as the sensor reports it.
    ranges : exact range to what the beam hit [m]; inf where it hit nothing.
    wall_ids : wall that the beam hit; -1 where it hit none.
    person_ids : person whom the beam hit; -1 where it hit none.
    mixed : whether the reported range lies between two things that the edges of the beam hit.
    """

    scan: LaserScan
    ranges: Array
    wall_ids: npt.NDArray[np.int64]
    person_ids: npt.NDArray[np.int64]
    mixed: npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Lidar:
    """A scanner with the noise of section III of the paper (eq. 1), and with further effects.

    Parameters
    ----------
    angles : nominal direction of each beam in the order in which they are taken, sensor frame, shape (n,) [rad].
    sigma_range : standard deviation of a range [m].
    sigma_bearing : standard deviation of the direction of a beam [rad].
    range_min, range_max : limits of measured ranges; outside of them there is no return [m].
    rate : scans per second [Hz].
    mounting : where the sensor sits on the robot.
    effects : errors beside the noise of the paper; by default none.

    Raises
    ------
    ValueError
        A sigma is negative, the rate is not positive, the limits are not 0 <= range_min < range_max, or a sweep takes
        longer than a scan.
    """

    angles: Array
    sigma_range: float
    sigma_bearing: float
    range_min: float
    range_max: float
    rate: float
    mounting: Mounting = field(default_factory=Mounting)
    effects: Effects = field(default_factory=Effects)

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
        if self.effects.sweep_time * self.rate > 1.0 + 1e-9:
            raise ValueError(
                f"sweep_time is {self.effects.sweep_time:g} s, but a scan is taken every {1.0 / self.rate:g} s"
            )

    @classmethod
    def of_preset(cls, name: str, mounting: Mounting | None = None, effects: Effects = Effects()) -> Self:  # noqa: B008, frozen
        """Make a scanner with the beams, the noise and the limits of a known sensor.

        Parameters
        ----------
        name : sensor preset of a laser scanner, such as ``rplidar-s1`` (920 beams over the full turn, 10 Hz) or
            ``sick-lms`` (180 beams from -90 deg by 1 deg, 5 Hz), or ``ideal`` (the beams of the first, without noise or
            limits).
        mounting : where the sensor sits on the robot; by default at its origin, facing forward.
        effects : errors beside the noise of the paper; those of a sensor are ``sim.EFFECTS[name]``.

        Raises
        ------
        ValueError
            No preset has this name, or it is no laser scanner.
        """
        mounting = mounting if mounting is not None else Mounting()
        if name == "ideal":
            return cls(_full_turn(920), 0.0, 0.0, 0.0, math.inf, 10.0, mounting, effects)
        model = sensor_preset(name)
        if name not in _BEAMS:
            raise ValueError(f"sensor preset {name!r} is no laser scanner: expected one of {', '.join(sorted(_BEAMS))}")
        angles, rate = _BEAMS[name]
        return cls(
            angles=angles.copy(),
            sigma_range=model.sigma_range,
            sigma_bearing=model.sigma_bearing,
            range_min=model.range_min,
            range_max=model.range_max,
            rate=rate,
            mounting=mounting,
            effects=effects,
        )

    @property
    def times(self) -> Array:
        """Time of each beam relative to the stamp of the scan, shape (n,) [s]; the last beam is taken at the stamp."""
        n = self.angles.size
        return self.effects.sweep_time * (np.arange(1.0, n + 1.0) - n) / max(n, 1)

    def scan(self, world: World, pose_world_robot: Pose, stamp: float, rng: np.random.Generator) -> LaserScan:
        """Take a scan as :meth:`measure` does, without the truth about the beams and without people."""
        return self.measure(world, pose_world_robot, stamp, rng).scan

    def measure(
        self,
        world: World,
        poses_world_robot: Array,
        stamp: float,
        rng: np.random.Generator,
        people: Sequence[Person] = (),
    ) -> Measurement:
        """Take a scan of the world, with the noise of section III of the paper and the effects.

        Noise is added to the direction of each beam before the ray is cast, and to its range after; the angle
        reported is the nominal one.

        Parameters
        ----------
        world : the walls.
        poses_world_robot : pose of the robot, shape (3,), or its pose at each beam, which is taken at ``stamp`` +
            :attr:`times`, shape (n, 3) [m, m, rad].
        stamp : time of the scan [s].
        rng : source of the noise.
        people : the people in the world.

        Returns
        -------
        Scan in the sensor frame with its truth; a range outside the limits, and a beam that hits nothing, is inf.

        Raises
        ------
        ValueError
            The poses have a wrong shape, or are not finite.
        """
        effects, times = self.effects, self.times
        poses = self._sensor_poses(np.asarray(poses_world_robot, dtype=np.float64))
        turning = -1.0 if self.mounting.upside_down else 1.0

        def cast(directions: Array) -> Hits:
            return cast_beams_at(world, people, effects.glass_incidence, poses, turning * directions, stamp + times)

        directions = self.angles + self.sigma_bearing * rng.standard_normal(times.size)
        echoes = effects.spread(directions, rng)
        hits = cast(echoes)
        ranges, mixed = hits.ranges, np.zeros(times.size, dtype=np.bool_)
        if effects.mixed_share > 0.0:
            half = effects.beam_width / 2.0
            ranges, mixed = mix_edges(hits, cast(directions - half), cast(directions + half), effects.mixed_share, rng)
        measured = ranges + effects.sigma(self.sigma_range, ranges) * rng.standard_normal(times.size)
        if effects.lose_beams:
            cosines = cos_incidence(world, people, hits, poses, turning * echoes, stamp + times)
            measured[rng.random(times.size) >= effects.return_probability(ranges, cosines)] = np.inf
        measured = round_to_step(measured, effects.range_step)
        measured[(measured < self.range_min) | (measured > self.range_max)] = np.inf
        scan = LaserScan(
            ranges=measured,
            angles=round_to_step(self.angles, effects.angle_step),
            stamp=stamp,
            times=times if effects.sweep_time > 0.0 else None,
        )
        return Measurement(scan, hits.ranges, hits.wall_ids, hits.person_ids, mixed)

    def _sensor_poses(self, poses_world_robot: Array) -> Array:
        """Return the pose of the sensor for each pose of the robot, shape (3,) or (n, 3), world frame [m, m, rad]."""
        if poses_world_robot.shape not in {(3,), (self.angles.size, 3)}:
            raise ValueError(
                f"expected one pose of the robot, shape (3,), or one for each of {self.angles.size} beams, "
                f"got shape {poses_world_robot.shape}"
            )
        mounting = self.mounting
        c, s = np.cos(poses_world_robot[..., 2]), np.sin(poses_world_robot[..., 2])
        poses = poses_world_robot + np.array([0.0, 0.0, mounting.theta])
        poses[..., 0] += c * mounting.x - s * mounting.y
        poses[..., 1] += s * mounting.x + c * mounting.y
        return poses
