"""The live driver: a scanner on a port becomes revolutions, and goes on doing so whatever happens to the cable."""

import logging
import time
from collections.abc import Iterator
from threading import Event, Thread
from types import TracebackType
from typing import Self

import numpy as np

from drivers.errors import DriverError
from drivers.frame import Frame
from drivers.rplidar.device import Device
from drivers.rplidar.ports import find_device
from drivers.rplidar.protocol.answers import DeviceInfo
from drivers.rplidar.protocol.counts import Counts
from drivers.rplidar.protocol.link import LinkClosedError
from drivers.rplidar.protocol.model import model_name, sensor_name
from drivers.rplidar.reader import RawTap, Reader
from drivers.rplidar.revolutions import ScanStream
from drivers.rplidar.scan_queue import ScanQueue
from features.scan import LaserScan
from features.sensor import Mounting

logger = logging.getLogger(__name__)

BACK_OFF = (0.5, 8.0)
"""First and longest pause between two attempts to find a scanner again; it doubles [s]."""

CLOSE_LIMIT = 5.0
"""For the thread to stop the motor and to end [s]."""

OTHERS = "rplidar-s1"
"""Sensor preset for a model without one of its own."""


class Rplidar:
    """A scanner as a source of frames, and of bare scans; a context manager, at whose end the motor stops.

    Inside the context the scanner is known and at rest, until it is started. Then a thread reads and decodes; a queue
    holds the last revolutions that were not taken. A scanner that is unplugged or
    falls silent is looked for until it is there again, at intervals that grow to 8 s; the log of this package says so.
    Stamps are seconds since 1970 by a clock that is set when the source is made and runs evenly from then on.

    Parameters
    ----------
    port : name of the port; None for the first with a scanner.
    mode : name of the scan mode; None for the typical one of the device.
    rpm : speed of an S-series scanner; None for 600.
    baud : speed of the link [bit/s]; None to find out.
    mounting : where the scanner sits on the robot.
    capacity : revolutions that the queue holds; the oldest is dropped where one more comes.

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
    def info(self) -> DeviceInfo:
        """Model, firmware and serial number of the scanner."""
        return self._found.info

    @property
    def name(self) -> str:
        """Name of the model, such as S1M1."""
        return model_name(self.info.model)

    @property
    def sensor(self) -> str:
        """Name of the sensor preset that fits the model."""
        return sensor_name(self.info.model) or OTHERS

    @property
    def mounting(self) -> Mounting:
        """Where the scanner sits on the robot."""
        return self._mounting

    @property
    def has_odometry(self) -> bool:
        """False: a scanner has no wheels."""
        return False

    @property
    def progress(self) -> float:
        """Zero: a live source has no end."""
        return 0.0

    @property
    def counts(self) -> Counts:
        """What became of the bytes and the revolutions so far."""
        return self._reader.counts + Counts(dropped_revolutions=self._queue.dropped, reconnects=self._reconnects)

    def take(self, timeout: float | None = None) -> LaserScan | None:
        """Oldest revolution that was not taken; None where none comes in time [s], or the source is closed.

        The scanner is started where it is not yet.
        """
        if self._thread is None:
            self.start()
        return self._queue.take(timeout)

    def scans(self) -> Iterator[LaserScan]:
        """Yield revolutions until the source is closed."""
        while (scan := self.take()) is not None:
            yield scan

    def __iter__(self) -> Iterator[Frame]:
        """Yield the revolutions as frames; there are no wheels, so the odometry pose is always the origin."""
        for scan in self.scans():
            yield Frame(scan.stamp, np.zeros(3), scan)

    def start(self, tap: RawTap | None = None) -> None:
        """Start motor and scan.

        Parameters
        ----------
        tap : takes the raw bytes down, in the thread that reads; what it raises ends the iteration with it.

        Raises
        ------
        DriverError
            The scanner does not start.
        """
        if self._thread is not None:
            raise ValueError("the scanner has been started already")
        device = self._found
        self._thread = Thread(target=self._run, args=(device, *self._start(device), tap), name="rplidar", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop scan and motor; what the queue still holds can be taken."""
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
            logger.warning("%s: the noise of this model is not known here, that of %s is taken", device.name, OTHERS)
        self._baud = device.baud
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _found(self) -> Device:
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
        """Read until the source is closed, over one connection after the other."""
        try:
            while True:
                try:
                    self._reader.read(device, stream, data, tap)
                    break
                except LinkClosedError:
                    break
                except DriverError as error:
                    logger.warning("%s; the scanner is looked for again", error)
                finally:
                    device.close()
                device, stream, data = self._reopen()
                self._reconnects += 1
                logger.warning("%s is there again", device.name)
        except LinkClosedError:
            pass
        except BaseException as failure:  # of the tap: to whoever takes the scans
            self._queue.end(failure)
        finally:
            self._queue.end()

    def _reopen(self) -> tuple[Device, ScanStream, bytes]:
        """Look for the scanner until it is there, with growing pauses."""
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
