"""Decodes the bytes of a scan, with their arrival times, into revolutions; the bytes may be live or recorded."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from drivers.counts import Counts
from drivers.rplidar.clock import SampleClock
from drivers.rplidar.codecs.decoder import SampleDecoder
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.codecs.outlier_filter import OutlierFilter
from drivers.rplidar.codecs.samples import Join, Samples
from drivers.rplidar.protocol.answers import Answer
from features.scan import LaserScan
from features.se2 import Array, wrap_angle


@dataclass(frozen=True, slots=True)
class ScanStream:
    """Parameters of a scan that are needed to decode its packets.

    Parameters
    ----------
    answer : type of the packets.
    us_per_sample : time from one sample to the next [us].
    baud : speed of the link [bit/s].
    """

    answer: Answer
    us_per_sample: float
    baud: int

    def to_record(self) -> dict[str, Any]:
        """Parameters as a JSON object."""
        return {"answer": int(self.answer), "us_per_sample": self.us_per_sample, "baud": self.baud}

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Parameters from a JSON object.

        Raises
        ------
        KeyError, TypeError, ValueError
            A parameter is missing or unusable.
        """
        return cls(Answer(record["answer"]), float(record["us_per_sample"]), int(record["baud"]))


class RevolutionDecoder:
    """Decodes one scan into complete revolutions.

    A revolution in which packets are missing is returned without their beams. One whose duration differs from those
    before spans two turns, or a part of one: it is counted as broken and discarded.

    Parameters
    ----------
    stream : parameters of the scan.
    """

    def __init__(self, stream: ScanStream) -> None:
        packet_format = FORMATS[stream.answer]
        self._pending = packet_format.pending
        self._decoder = SampleDecoder(stream.answer)
        wire_time = packet_format.size * 10.0 / stream.baud
        self._period = stream.us_per_sample * 1e-6
        self._clock = SampleClock(self._period, packet_format.samples, wire_time)
        self._durations = OutlierFilter()
        self._parts: list[tuple[Array, Array, Array]] = []
        self._started = self._patchy = False
        self._counts = Counts()

    @property
    def counts(self) -> Counts:
        """What became of the bytes so far."""
        return self._decoder.counts + self._counts

    def feed(self, data: bytes, time: float) -> list[LaserScan]:
        """Decode the next bytes.

        Parameters
        ----------
        data : bytes of the device, split anywhere.
        time : when they arrived, on any clock [s].

        Returns
        -------
        Revolutions that are complete with these bytes: angles counter-clockwise from -pi to pi, ascending; each beam
        with its time; the stamp is that of the last beam, on the clock of ``time``.
        """
        scans: list[LaserScan] = []
        for samples in self._decoder.feed(data):
            if samples.join is not Join.FOLLOWS:
                self._clock.reset()
            self._clock.arrive(int(samples.packets[-1]) + self._pending, time)
            scans += self._split(samples, self._clock.times(int(samples.packets[0]), len(samples)))
        return scans

    def _split(self, samples: Samples, times: Array) -> list[LaserScan]:
        """Split samples where revolutions start, and return the revolutions that end."""
        if samples.join is Join.RESTART:
            self._started = False
        self._patchy |= samples.join is Join.GAP
        scans: list[LaserScan] = []
        first = 0
        for start in samples.starts.nonzero()[0].tolist():
            self._add(samples, times, first, start)
            if self._started:
                scans += self._close(times[start])
            self._parts, self._started, first = [], True, start
            # A gap right before the first sample of a revolution may have cost it samples of its own.
            self._patchy = start == 0 and samples.join is Join.GAP
        self._add(samples, times, first, len(samples))
        return scans

    def _add(self, samples: Samples, times: Array, first: int, end: int) -> None:
        if self._started:
            self._parts.append((samples.angles_clockwise[first:end], samples.ranges[first:end], times[first:end]))

    def _close(self, end: float) -> list[LaserScan]:
        clockwise, ranges, times = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        # Without a gap the number of samples gives the duration; the clock jumps where this computer read late.
        duration = end - times[0] if self._patchy else len(times) * self._period
        if not self._durations.accepts(duration):
            self._counts += Counts(broken_revolutions=1)
            return []
        self._counts += Counts(revolutions=1, patchy_revolutions=self._patchy)
        angles = wrap_angle(-clockwise)
        order = np.argsort(angles, kind="stable")
        stamp = times[-1]
        ranges = np.where(ranges > 0.0, ranges, np.inf)
        return [LaserScan(ranges[order], angles[order], float(stamp), (times - stamp)[order])]
