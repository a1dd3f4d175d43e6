"""When samples were taken, told from when their packets came."""

import numpy as np

from features.se2 import Array

DRIFT = 0.01
"""Share by which the period of the scanner may be longer than it says, or the clocks may differ."""


class SampleClock:
    """Times of the samples of one unbroken stretch.

    A scanner samples evenly, but its packets come late by what the link, the adapter and the host make of it. So the
    samples count on from the least delayed packet, and what comes later than that is believed at a rate of
    :data:`DRIFT` only: a host that does not read for seconds shifts nothing. A sample is older than the last of its
    packet by their distance, and this one than the arrival by the time the packet takes on the wire, one period that
    the device filters over, and half of one to the middle of the sample (the SDK's delays).

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
        self._begin, self._packet = np.inf, 0

    def reset(self) -> None:
        """Forget the packets so far: the next are not counted on from them."""
        self._begin = np.inf

    def arrive(self, packet: int, time: float) -> None:
        """Note that the packet of this number was the last one there at a time [s]."""
        passed = (packet - self._packet) * self._samples * self._period
        begin = time - ((packet + 1) * self._samples - 1) * self._period
        self._begin, self._packet = min(begin, self._begin + DRIFT * passed), packet

    def times(self, packet: int, count: int) -> Array:
        """Tell the times of samples from the first of a packet on, shape (count,) [s]; they never go back."""
        begin = self._begin - self._delay
        times = begin + self._period * (packet * self._samples + np.arange(count))
        times = np.maximum(times, self._latest)
        self._latest = times[-1]
        return times
