"""Decoded samples of all packet formats."""

import math
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
import numpy.typing as npt

from features.se2 import Array

Flags = npt.NDArray[np.bool_]
Packets = npt.NDArray[np.void]
"""Packets as they are transmitted: a structured array of one of the packet types."""

TURN_Q6 = 360 * 64
RADIANS_PER_Q6 = 2.0 * math.pi / TURN_Q6

NOMINAL_QUALITY = 0x2F << 2
"""Quality of a sample with a return, for packets without quality."""


class Join(Enum):
    """Relation of samples to those before."""

    FOLLOWS = auto()
    GAP = auto()
    """Packets are missing in between."""
    RESTART = auto()
    """The device lost its angle, or started to scan: the revolution so far is invalid."""


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of consecutive packets, shape (n,) each, in the order in which they were taken.

    Parameters
    ----------
    angles_clockwise : direction as the device counts it, clockwise seen from above, from 0 to 2 pi [rad].
    ranges : [m]; 0 is no return.
    qualities : strength of the return, 0 to 255.
    starts : whether a sample is the first of a revolution.
    packets : number of the packet that a sample came in, counted from the start of the stream.
    join : relation of the first sample to the one before it.
    """

    angles_clockwise: Array
    ranges: Array
    qualities: npt.NDArray[np.uint8]
    starts: Flags
    packets: npt.NDArray[np.int64]
    join: Join = Join.FOLLOWS

    def __len__(self) -> int:
        return self.ranges.size


def to_q6(angles: Array | float) -> npt.NDArray[np.int64]:
    """Angles [rad] in 64ths of a degree, 0 to 23039."""
    return np.rint(np.asarray(angles) / RADIANS_PER_Q6).astype(np.int64) % TURN_Q6


def to_metres(steps: npt.NDArray[np.integer], steps_per_metre: int) -> Array:
    """Ranges in whole steps as metres."""
    return np.divide(steps, steps_per_metre, dtype=np.float64)


def to_steps(ranges: Array, steps_per_metre: int, limit: int) -> npt.NDArray[np.int64]:
    """Ranges [m] in whole steps.

    Raises
    ------
    ValueError
        A range is negative, not finite, or above the limit.
    """
    steps = np.rint(np.asarray(ranges, dtype=np.float64) * steps_per_metre)
    if not ((steps >= 0) & (steps <= limit)).all():
        raise ValueError(f"ranges must lie between 0 and {limit / steps_per_metre:g} m to be encoded")
    return steps.astype(np.int64)
