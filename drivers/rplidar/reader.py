"""Reads one scan after the other, in a thread of its own."""

import time
from threading import Event
from typing import Protocol

from drivers.errors import DriverError
from drivers.rplidar.device import Device
from drivers.rplidar.protocol.counts import Counts
from drivers.rplidar.revolutions import RevolutionDecoder, ScanStream
from drivers.rplidar.scan_queue import ScanQueue

READ_INTERVAL = 0.01
"""Pause between two reads, so that bytes come in lots that are worth the work [s]."""

SPIN_UP = 10.0
"""For the first bytes of a scan: they wait until the head turns steadily [s]."""

SILENCE = 3.0
"""Without bytes, later, after which the scanner is lost [s]."""

FRUITLESS = 5.0
"""Without a revolution although bytes come, after which the scanner is lost; in seconds of the full link."""


class RawTap(Protocol):
    """Takes every byte of the scans down, in the thread that reads."""

    def begin(self, stream: ScanStream, time: float) -> None:
        """Note that a scan begins: what follows is to be decoded afresh."""
        ...

    def chunk(self, data: bytes, time: float) -> None:
        """Take bytes, which came at a time [s since 1970]."""
        ...


class Reader:
    """Reads scans from a device into a queue, one scan after the other.

    Parameters
    ----------
    queue : takes the revolutions.
    closing : set to end.
    epoch : when the monotonic clock of this computer began [s since 1970].

    Attributes
    ----------
    counts : what became of the bytes of all scans so far.
    """

    def __init__(self, queue: ScanQueue, closing: Event, epoch: float) -> None:
        self.counts = Counts()
        self._queue, self._closing, self._epoch = queue, closing, epoch

    def read(self, device: Device, stream: ScanStream, data: bytes, tap: RawTap | None = None) -> None:
        """Read a scan until the end.

        Parameters
        ----------
        device : that scans.
        stream : how to read what it sends.
        data : the first bytes of it.
        tap : takes the bytes down.

        Raises
        ------
        DriverError
            The scanner is lost, or silent, or what it sends makes no sense.
        """
        decoder, before = RevolutionDecoder(stream), self.counts
        now = last = time.monotonic()
        patience, fruitless = SPIN_UP, 0
        if tap is not None:
            tap.begin(stream, self._epoch + now)
        while not self._closing.is_set():
            if data:
                if tap is not None:
                    tap.chunk(data, self._epoch + now)
                scans = decoder.feed(data, self._epoch + now)
                self.counts = before + decoder.counts
                for scan in scans:
                    self._queue.put(scan)
                last, patience = now, SILENCE
                fruitless = 0 if scans else fruitless + len(data)
                if fruitless > FRUITLESS * stream.baud / 10.0:
                    raise DriverError(f"{device.name}: {fruitless} bytes came without a whole revolution")
                self._closing.wait(READ_INTERVAL)
            elif now - last > patience:
                raise DriverError(f"{device.name}: no sample came for {patience:g} s")
            data, now = device.read(), time.monotonic()
