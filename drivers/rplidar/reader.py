"""Reads the bytes of a scanner, decodes them and queues the revolutions."""

import time
from threading import Event

from drivers.counts import Counts
from drivers.errors import DriverError
from drivers.live_source import RawTap
from drivers.rplidar.device import Device
from drivers.rplidar.revolutions import RevolutionDecoder, ScanStream
from drivers.rplidar.scan_queue import ScanQueue

READ_INTERVAL = 0.01
"""Pause between two reads, so that each read returns enough bytes to be decoded efficiently [s]."""

SPIN_UP = 10.0
"""Longest wait for the first bytes of a scan, which come when the head turns at its set speed [s]."""

SILENCE = 3.0
"""Longest time without bytes during a scan; after it the scanner counts as lost [s]."""

FRUITLESS = 5.0
"""Bytes without a complete revolution after which the scanner counts as lost, as seconds at the full link speed."""


class Reader:
    """Reads the scans of a device into a queue.

    Parameters
    ----------
    queue : receives the revolutions.
    closing : set by another thread to end the reading.
    epoch : time at which the monotonic clock of this computer was zero [s since 1970].

    Attributes
    ----------
    counts : what became of the bytes of all scans so far.
    """

    def __init__(self, queue: ScanQueue, closing: Event, epoch: float) -> None:
        self.counts = Counts()
        self._queue, self._closing, self._epoch = queue, closing, epoch

    def read(self, device: Device, stream: ScanStream, data: bytes, tap: RawTap | None = None) -> None:
        """Read a scan until ``closing`` is set.

        Parameters
        ----------
        device : whose scan was started.
        stream : parameters of the scan.
        data : its first bytes.
        tap : receives all bytes.

        Raises
        ------
        DriverError
            The connection is lost, no bytes come, or no revolution can be decoded from them.
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
