"""Decodes the byte stream of a scan into samples."""

from dataclasses import replace

import numpy as np

from drivers.counts import Counts
from drivers.rplidar.codecs.capsule import last_encoder_q6, restarts, starts_q6
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.codecs.framing import framer
from drivers.rplidar.codecs.outlier_filter import OutlierFilter
from drivers.rplidar.codecs.samples import TURN_Q6, Join, Packets, Samples
from drivers.rplidar.protocol.answers import Answer

BACKWARDS = np.radians(10.0)
"""Largest decrease of the angle within a revolution: the optical offset is at most 8 deg [rad]."""


class SampleDecoder:
    """Decodes bytes into samples as soon as they are complete; never raises, whatever the bytes.

    Parameters
    ----------
    answer : type of the packets, from the descriptor of the scan.
    """

    def __init__(self, answer: Answer) -> None:
        self._format = FORMATS[answer]
        self._framer = framer(answer)
        self._counts = Counts()
        self._join = Join.RESTART
        self._received = 0
        self._waiting = b""  # the last capsule, whose angles the next one determines
        self._turned = OutlierFilter()
        self._last_encoder = np.nan
        self._last_angle = np.nan

    @property
    def counts(self) -> Counts:
        """What became of the bytes so far."""
        return self._framer.counts + self._counts

    def feed(self, data: bytes) -> list[Samples]:
        """Decode the next bytes.

        Returns
        -------
        Samples that are complete with these bytes, in order; ``join`` of an element is its relation to the one before.
        """
        decode = self._nodes if self._format.measure is None else self._capsules
        return [samples for packets, gap in self._framer.feed(data) for samples in decode(packets, gap)]

    def _nodes(self, packets: Packets, gap: bool) -> list[Samples]:
        """Decode packets that contain the angle of each sample."""
        if gap:
            self._lose()
        samples = self._joined(self._format.decode(packets, self._received))
        if samples.join is Join.GAP and samples.angles_clockwise[0] < self._last_angle - BACKWARDS:
            samples.starts[0] = True  # the first sample of the revolution was lost
        self._last_angle = samples.angles_clockwise[-1]
        self._received += len(packets)
        return [samples]

    def _capsules(self, packets: Packets, gap: bool) -> list[Samples]:
        """Decode all capsules but the last; it waits for the next one."""
        if gap:
            self._lose()
            self._waiting = b""
        old = len(self._waiting) // self._format.size
        capsules = np.frombuffer(self._waiting + packets.tobytes(), self._format.dtype)
        first = self._received - old
        starts = starts_q6(capsules)
        turned = ((starts[1:] - starts[:-1]) % TURN_Q6).tolist()
        restarted = restarts(capsules).tolist()
        found: list[Samples] = []
        start = 0
        for k in range(old, len(capsules)):
            if restarted[k]:
                found += self._pairs(capsules[start:k], first + start)
                start = k
                self._counts += Counts(restarts=first + k > 0)
                self._join, self._last_encoder, self._turned = Join.RESTART, np.nan, OutlierFilter()
            elif k > start and not self._turned.accepts(turned[k - 1]):
                found += self._pairs(capsules[start:k], first + start)
                start = k
                self._counts += Counts(discontinuities=1)
                self._lose()
        found += self._pairs(capsules[start:], first + start)
        self._waiting = capsules[-1:].tobytes()
        self._received += len(packets)
        return found

    def _pairs(self, capsules: Packets, first: int) -> list[Samples]:
        if len(capsules) < 2:
            return []
        samples = self._joined(self._format.decode(capsules, first, self._last_encoder))
        self._last_encoder = last_encoder_q6(capsules, self._format.samples)
        return [samples]

    def _lose(self) -> None:
        """Mark that packets are missing before the next samples."""
        if self._join is Join.FOLLOWS:
            self._join = Join.GAP

    def _joined(self, samples: Samples) -> Samples:
        joined = replace(samples, join=self._join)
        self._join = Join.FOLLOWS
        return joined
