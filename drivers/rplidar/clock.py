"""When samples were taken, told from when their packets came."""

from collections import deque

import numpy as np

from features.se2 import Array

WINDOW = 0.5
"""Time over which the earliest arrival is looked for [s]."""


class SampleClock:
    """Times of the samples of one unbroken stretch.

    A scanner samples evenly, but its packets come late by what the link, the adapter and the host make of it. So the
    least delayed packet of the last :data:`WINDOW` gives the time, and the samples count on from it. A sample is older
    than the last of its packet by their distance, and this one than the arrival by the time the packet takes on the
    wire, one period that the device filters over, and half of one to the middle of the sample (the SDK's delays).

    Parameters
    ----------
    period : time from one sample to the next [s].
    samples : in a packet.
    wire_time : that a packet takes on the wire [s].
    """

    def __init__(self, period: float, samples: int, wire_time: float) -> None:
        self._period = period
        self._samples = samples
        self._delay = wire_time + 1.5 * period
        self._latest = -np.inf
        self._begins: deque[tuple[float, float]] = deque()

    def reset(self) -> None:
        """Forget the packets so far: the next are not counted on from them."""
        self._begins.clear()

    def arrive(self, packet: int, time: float) -> None:
        """Note that the packet of this number was the last one there at a time [s]."""
        self._begins.append((time, time - ((packet + 1) * self._samples - 1) * self._period))
        while self._begins[0][0] < time - WINDOW:
            self._begins.popleft()

    def times(self, packet: int, count: int) -> Array:
        """Tell the times of samples from the first of a packet on, shape (count,) [s]; they never go back."""
        begin = min(begin for _, begin in self._begins) - self._delay
        times = begin + self._period * (packet * self._samples + np.arange(count))
        times = np.maximum(times, self._latest)
        self._latest = times[-1]
        return times
