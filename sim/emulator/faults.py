"""Faults of a scanner on a serial line, each kind at random times of its own."""

import math
from collections.abc import Iterable, Mapping
from types import MappingProxyType

import numpy as np

FAULTS: Mapping[str, tuple[float, str]] = MappingProxyType(
    {
        "flipped-bytes": (2.0, "a byte of a packet arrives with another value"),
        "lost-bytes": (2.0, "1 to 20 bytes in a row do not arrive"),
        "split-reads": (math.inf, "packets arrive in pieces of 1 to 16 bytes"),
        "stale-samples": (math.inf, "the scan of an earlier program goes on, and its samples come before each answer"),
        "banner": (math.inf, "text is printed after a reset, whatever the model"),
        "silent-reset": (math.inf, "2 s of silence after a reset, whatever the model"),
        "protection-stop": (30.0, "starts in protection stop, and falls into it while scanning"),
        "wrong-baud": (math.inf, "the line runs at the rate of another model"),
        "unplug": (30.0, "the cable is pulled out while scanning, for 1 to 3 s"),
        "encoder-reset": (10.0, "the angle is lost for a part of a turn"),
        "speed-change": (5.0, "the rotation becomes up to 20 % faster or slower"),
        "zero-sectors": (5.0, "a sector of 10 to 60 deg returns nothing, and it changes"),
        "stall": (20.0, "the host reads nothing for 2 s, and its buffer holds 64 KiB"),
    }
)
"""Faults by name: mean time between two of a kind [s], infinite where it is a lasting property, and a description.

The times are chosen so that each kind comes many times in a drive of ten minutes, but most revolutions stay whole."""


class Faults:
    """The faults that are switched on; the times of one kind do not depend on which others are on.

    Parameters
    ----------
    names : names of the faults.
    seed : seed of their times and of their effects.

    Raises
    ------
    ValueError
        No fault has this name.
    """

    def __init__(self, names: Iterable[str] = (), seed: int = 0) -> None:
        self._names = frozenset(names)
        if unknown := self._names - FAULTS.keys():
            raise ValueError(f"unknown fault {min(unknown)!r}: known are {', '.join(FAULTS)}")
        seeds = np.random.SeedSequence(seed).spawn(len(FAULTS))
        self.rng = {name: np.random.default_rng(own) for name, own in zip(FAULTS, seeds, strict=True)}
        self._next = {name: self._after(name, 0.0) for name in self._names}

    def __contains__(self, name: str) -> bool:
        return name in self._names

    def strikes(self, name: str, time: float) -> bool:
        """Whether a fault of this kind has occurred up to this time [s] since the last call."""
        if self._next.get(name, math.inf) > time:
            return False
        self._next[name] = self._after(name, time)
        return True

    def _after(self, name: str, time: float) -> float:
        """Draw the time of the next fault [s]: at least half of the mean interval later."""
        mean, _ = FAULTS[name]
        return math.inf if math.isinf(mean) else time + mean * (0.5 + self.rng[name].exponential(0.5))
