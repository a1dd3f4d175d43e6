"""Estimates when samples were taken from when their packets arrived."""

import numpy as np

from features.se2 import Array

DRIFT = 0.01
"""Largest relative error that is assumed of the sample period as the scanner states it."""


class SampleClock:
    """Times of the samples of consecutive packets.

    A scanner samples at a constant rate, but link, adapter and host delay its packets by varying times. The times are
    therefore extrapolated from the least delayed packet at the sample period; later arrivals shift them by no more than
    :data:`DRIFT` of the time that has passed, so that a host that does not read for seconds shifts nothing. The last
    sample of a packet is older than its arrival by the packet's time on the wire, one period of filtering in the device
    and half a period to the middle of the sample (the delays of the SDK).

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
        self._start, self._packet = np.inf, 0

    def reset(self) -> None:
        """Start again with the next packet, as after a gap."""
        self._start = np.inf

    def arrive(self, packet: int, time: float) -> None:
        """Use the arrival time [s] of the packet of this number, the newest that has arrived."""
        passed = (packet - self._packet) * self._samples * self._period
        start = time - ((packet + 1) * self._samples - 1) * self._period
        self._start, self._packet = min(start, self._start + DRIFT * passed), packet

    def times(self, packet: int, count: int) -> Array:
        """Return the times of the first samples from a packet on, shape (count,) [s]; they never decrease."""
        start = self._start - self._delay
        times = start + self._period * (packet * self._samples + np.arange(count))
        times = np.maximum(times, self._latest)
        self._latest = times[-1]
        return times
