"""Effects of real scanners that the noise of section III of the paper leaves out."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

import numpy as np

from features.se2 import Array

_HIGHEST = {"mixed_share": 1.0, "lost_share": 1.0, "glass_incidence": math.pi / 2.0}
"""Largest value of the parameters that have one."""


@dataclass(frozen=True, slots=True)
class Effects:
    """Effects on the beams of a scan, each off by default.

    Parameters
    ----------
    sweep_time : time from the first beam of a scan to the first of the next sweep over the same angles [s]; each beam
        is cast from the pose of the robot at its time, the last one at the stamp. 0 takes all beams at once.
    beam_width : full angle over which a beam spreads [rad]; the echo comes from a uniform direction in it, which adds a
        variance of ``beam_width^2 / 12`` to that of the bearing.
    mixed_share : probability that a beam whose two edges hit different things gives a uniform range between those
        of its edges (a mixed pixel).
    range_growth : the variance of a range r is ``sigma_range^2 + (range_growth r)^2`` [m/m].
    lost_share : probability that a beam is lost, whatever it hits.
    fade_range : a beam at range r and incidence i returns with the probability ``exp(-(r / fade_range)^2 / cos(i))``
        [m]: that is the probability that an echo of exponentially distributed power (speckle), whose mean falls with
        ``cos(i) / r^2``, exceeds the threshold of the detector. Infinity keeps all beams.
    glass_incidence : a wall of glass returns beams up to this incidence and lets the others through [rad]; pi / 2
        makes glass a wall like any other.
    range_step : ranges are reported in whole multiples of it [m]; 0 reports them unrounded.
    angle_step : angles are reported in whole multiples of it [rad]; 0 reports them unrounded.

    Raises
    ------
    ValueError
        A value is out of its limits, or there are mixed pixels but the beam has no width.
    """

    sweep_time: float = 0.0
    beam_width: float = 0.0
    mixed_share: float = 0.0
    range_growth: float = 0.0
    lost_share: float = 0.0
    fade_range: float = math.inf
    glass_incidence: float = math.pi / 2.0
    range_step: float = 0.0
    angle_step: float = 0.0

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            highest = _HIGHEST.get(name, math.inf)
            if not 0.0 <= value <= highest or (math.isinf(value) and name != "fade_range"):
                raise ValueError(f"{name} is {value:g}: expected a number from 0 to {highest:g}")
        if self.fade_range == 0.0:
            raise ValueError("fade_range is 0: expected a positive range")
        if self.mixed_share > 0.0 and self.beam_width == 0.0:
            raise ValueError(f"mixed_share is {self.mixed_share:g}, but a beam of beam_width 0 has no edges")

    def spread(self, directions: Array, rng: np.random.Generator) -> Array:
        """Draw the directions from which the echoes of beams come, shape (n,) [rad]."""
        if self.beam_width == 0.0:
            return directions
        return directions + self.beam_width * rng.uniform(-0.5, 0.5, directions.size)

    def sigma(self, sigma_range: float, ranges: Array) -> float | Array:
        """Return the standard deviation of each range, shape (n,), or one for all [m]."""
        if self.range_growth == 0.0:
            return sigma_range
        return np.hypot(sigma_range, self.range_growth * np.where(np.isfinite(ranges), ranges, 0.0))

    @property
    def lose_beams(self) -> bool:
        """Whether any beam can be lost."""
        return self.lost_share > 0.0 or math.isfinite(self.fade_range)

    def return_probability(self, ranges: Array, cosines: Array) -> Array:
        """Return the probability that beams of these ranges [m] and cosines of incidence return, shape (n,)."""
        if math.isinf(self.fade_range):
            return np.full(ranges.size, 1.0 - self.lost_share)
        fading = (ranges / self.fade_range) ** 2 / np.maximum(cosines, np.finfo(np.float64).tiny)
        return (1.0 - self.lost_share) * np.exp(-fading)


def round_to_step(values: Array, step: float) -> Array:
    """Round values to whole multiples of a step; with a step of 0 they are unchanged."""
    return values if step == 0.0 else step * np.round(values / step)


def _rplidar(range_max: float, returned: float) -> Effects:
    """Return the effects of an RPLIDAR that sees white up to a range [m], where so many of the beams return.

    Sweep, steps and range are those of its data sheet and protocol: 10 Hz, whole millimetres and 1/64 deg. Width,
    shares and incidence are assumed.
    """
    return Effects(
        sweep_time=0.1,
        beam_width=3e-3,
        mixed_share=0.3,
        lost_share=2e-3,
        fade_range=range_max / math.sqrt(-math.log(returned)),
        glass_incidence=math.radians(10.0),
        range_step=1e-3,
        angle_step=math.radians(1.0 / 64.0),
    )


EFFECTS: Mapping[str, Effects] = MappingProxyType(
    {
        "ideal": Effects(),
        # By time of flight: the range ends where the light is too weak.
        "rplidar-s1": _rplidar(40.0, 0.5),
        "rplidar-s2": _rplidar(30.0, 0.5),
        # Triangulating: it ends where a pixel of the camera is too coarse, with light to spare.
        "rplidar-a1": _rplidar(12.0, 0.9),
        "rplidar-a2": _rplidar(16.0, 0.9),
        "rplidar-a3": _rplidar(25.0, 0.9),
        # From its data sheet: a mirror at 75 Hz that scans during half a turn, whole centimetres, 4.4 mrad, and 80 m,
        # where half of the beams are assumed to return. Shares and incidence are assumed.
        "sick-lms": Effects(
            sweep_time=0.5 / 75.0,
            beam_width=4.4e-3,
            mixed_share=0.5,
            lost_share=1e-3,
            fade_range=80.0 / math.sqrt(math.log(2.0)),
            glass_incidence=math.radians(10.0),
            range_step=1e-2,
        ),
    }
)
"""Effects of known sensors by the name that the command line takes."""


def effects_of(name: str, sensor: str) -> Effects:
    """Return effects by the name that the command line takes.

    Parameters
    ----------
    name : a name in :data:`EFFECTS`, ``on`` for those of the sensor, or ``off`` for none.
    sensor : preset of the sensor.
    """
    return EFFECTS[{"on": sensor, "off": "ideal"}.get(name, name)]
