"""The live driver: revolutions of a scanner on a serial port, which is reopened when the connection is lost."""

import logging
import time
from collections.abc import Iterator
from threading import Event, Thread
from types import TracebackType
from typing import Self

import numpy as np

from drivers.counts import Counts
from drivers.errors import DriverError
from drivers.frame import Frame, SourceInfo
from drivers.live_source import LiveSource, RawTap
from drivers.rplidar.device import Device
from drivers.rplidar.ports import find_device
from drivers.rplidar.protocol.answers import DeviceInfo
from drivers.rplidar.protocol.link import LinkClosedError
from drivers.rplidar.protocol.model import model_name, sensor_name
from drivers.rplidar.reader import Reader
from drivers.rplidar.revolutions import ScanStream
from drivers.rplidar.scan_queue import ScanQueue
from features.scan import LaserScan
from features.sensor import Mounting

logger = logging.getLogger(__name__)

BACK_OFF = (0.5, 8.0)
"""First and longest pause between two attempts to reconnect; it doubles from one to the next [s]."""

CLOSE_LIMIT = 5.0
"""Longest wait for the reading thread to stop the motor and to end [s]."""

FALLBACK = "rplidar-s1"
"""Sensor preset of a model that has none of its own."""


class Rplidar(LiveSource):
    """An RPLIDAR as a source of frames, and of scans; a context manager that opens it, and stops the motor at its end.

    After :meth:`start` a thread reads and decodes; a queue keeps the last revolutions that were not taken. When the
    scanner is unplugged or sends nothing, the driver tries to reconnect until it succeeds, at intervals that grow to
    8 s, and says so in the log of this package. Stamps are seconds since 1970 by a clock that is set when the source is
    made and runs evenly from then on.

    Parameters
    ----------
    port : name of the serial port; None for the first one with a scanner.
    mode : name of the scan mode; None for the typical one of the scanner.
    rpm : rotation rate of an S-series scanner [1/min]; None for 600.
    baud : speed of the link [bit/s]; None to detect it.
    mounting : where the scanner sits on the robot.
    capacity : revolutions that the queue keeps; one more drops the oldest.

    Raises
    ------
    DriverError
        When entered: there is no scanner, it cannot be used, or it has no such mode.
    """

    def __init__(
        self,
        port: str | None = None,
        *,
        mode: str | None = None,
        rpm: int | None = None,
        baud: int | None = None,
        mounting: Mounting = Mounting(),  # noqa: B008, frozen
        capacity: int = 10,
    ) -> None:
        self._port, self._mode, self._rpm, self._baud, self._mounting = port, mode, rpm, baud, mounting
        self._closing = Event()
        self._queue = ScanQueue(capacity)
        self._reader = Reader(self._queue, self._closing, time.time() - time.monotonic())
        self._reconnects = 0
        self._device: Device | None = None
        self._thread: Thread | None = None

    @property
    def device_info(self) -> DeviceInfo:
        """Model, firmware and serial number of the scanner."""
        return self._opened.info

    @property
    def info(self) -> SourceInfo:
        """Name of the model, such as S1M1, and the sensor preset that fits it; no odometry."""
        model = self.device_info.model
        return SourceInfo(model_name(model), sensor_name(model) or FALLBACK, self._mounting, has_odometry=False)

    @property
    def counts(self) -> Counts:
        """What was received and lost so far."""
        return self._reader.counts + Counts(dropped_revolutions=self._queue.dropped, reconnects=self._reconnects)

    def take(self, timeout: float | None = None) -> LaserScan | None:
        """Take the oldest revolution that was not taken; start the scanner if it was not started.

        Returns None after a timeout [s], or when the source is closed and no revolution is left.
        """
        if self._thread is None:
            self.start()
        return self._queue.take(timeout)

    def scans(self) -> Iterator[LaserScan]:
        """Yield revolutions until the source is closed."""
        while (scan := self.take()) is not None:
            yield scan

    def __iter__(self) -> Iterator[Frame]:
        """Yield the revolutions as frames; without odometry their pose is always the origin."""
        for scan in self.scans():
            yield Frame(scan.stamp, np.zeros(3), scan)

    def start(self, tap: RawTap | None = None) -> None:
        """Start motor and scan.

        Parameters
        ----------
        tap : receives the raw bytes, in the thread that reads; an exception that it raises ends the iteration.

        Raises
        ------
        DriverError
            The scanner does not start.
        """
        if self._thread is not None:
            raise ValueError("the scanner has been started already")
        device = self._opened
        self._thread = Thread(target=self._run, args=(device, *self._start(device), tap), name="rplidar", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop scan and motor; revolutions that are in the queue can still be taken."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join(CLOSE_LIMIT)
        elif self._device is not None:
            self._device.close()

    def __enter__(self) -> Self:
        self._device = device = find_device(self._port, self._closing, self._baud)
        try:
            mode = device.mode(self._mode)
        except DriverError:
            device.close()
            raise
        logger.info("%s at %d baud, serial number %s, %s", device.name, device.baud, device.info.serial, mode.name)
        if sensor_name(device.info.model) is None:
            logger.warning("%s: the noise of this model is not known here, that of %s is taken", device.name, FALLBACK)
        self._baud = device.baud
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _opened(self) -> Device:
        if self._device is None:
            raise ValueError("the scanner has not been opened: use it in a `with` block")
        return self._device

    def _start(self, device: Device) -> tuple[ScanStream, bytes]:
        """Start the scan of a device at rest."""
        try:
            return device.start(device.mode(self._mode), self._rpm)
        except BaseException:
            device.close()
            raise

    def _run(self, device: Device, stream: ScanStream, data: bytes, tap: RawTap | None) -> None:
        """Read until the source is closed; reconnect when the scanner is lost."""
        try:
            while True:
                try:
                    self._reader.read(device, stream, data, tap)
                    break
                except LinkClosedError:
                    break
                except DriverError as error:
                    logger.warning("%s; reconnecting", error)
                finally:
                    device.close()
                device, stream, data = self._reopen()
                self._reconnects += 1
                logger.warning("%s is connected again", device.name)
        except LinkClosedError:
            pass
        except BaseException as failure:  # raised by the tap: raised again where the scans are taken
            self._queue.end(failure)
        finally:
            self._queue.end()

    def _reopen(self) -> tuple[Device, ScanStream, bytes]:
        """Try to reconnect until it succeeds, with growing pauses."""
        pause, longest = BACK_OFF
        while not self._closing.wait(pause):
            try:
                device = find_device(self._port, self._closing, self._baud)
                return device, *self._start(device)
            except LinkClosedError:
                raise
            except DriverError as error:
                logger.info("%s", error)
            pause = min(2.0 * pause, longest)
        raise LinkClosedError("the driver is being closed")
