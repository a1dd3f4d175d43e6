"""The serial port of a scanner."""

import errno
import time
from contextlib import suppress
from threading import Event

import serial

from drivers.errors import DriverError

READ_WAIT = 0.05
"""Longest wait of a read for its first byte [s]."""

_HINTS = {
    errno.ENOENT: "there is no such port: `cwlf-slam devices` lists those that are there",
    errno.EACCES: "permission denied: add yourself to the group that owns the port (often dialout) and log in again",
    errno.EAGAIN: "another program uses the port: end it first",
    errno.EBUSY: "another program uses the port: end it first",
}


class LinkClosedError(DriverError):
    """The driver is being closed."""


class Link:
    """A serial port whose failures are :class:`DriverError`.

    Parameters
    ----------
    port : name of the port.
    closing : set by another thread to close the driver; reads then raise :class:`LinkClosedError`.

    Raises
    ------
    DriverError
        The port cannot be opened.
    """

    def __init__(self, port: str, closing: Event) -> None:
        self.port = port
        self._closing = closing
        self._serial = serial.Serial(timeout=READ_WAIT, write_timeout=1.0, exclusive=True)
        self._serial.port = port
        try:
            self._serial.open()
        except (OSError, ValueError) as error:
            hint = _HINTS.get(getattr(error, "errno", None) or 0)
            raise DriverError(f"{port}: {hint or f'cannot be opened as a serial port ({error})'}") from None

    @property
    def baud(self) -> int:
        """Speed [bit/s]."""
        return self._serial.baudrate

    @baud.setter
    def baud(self, baud: int) -> None:
        try:
            self._serial.baudrate = baud
        except (OSError, ValueError) as error:
            raise DriverError(f"{self.port}: cannot be set to {baud} baud: {error}") from None

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._serial.write(data)
        except (OSError, serial.SerialException) as error:
            raise self._lost(error) from None

    def read(self) -> bytes:
        """Receive the available bytes, after a wait of up to :data:`READ_WAIT` for the first; may be empty."""
        if self._closing.is_set():
            raise LinkClosedError(f"{self.port}: the driver is being closed")
        try:
            first = self._serial.read(1)
            return first + self._serial.read(self._serial.in_waiting) if first else b""
        except (OSError, serial.SerialException) as error:
            raise self._lost(error) from None

    def drain(self, quiet: float, limit: float) -> bytes:
        """Receive until no byte has come for ``quiet`` [s], for ``limit`` [s] at most; return the bytes."""
        received = bytearray()
        start = last = time.monotonic()
        while (now := time.monotonic()) - last < quiet and now - start < limit:
            if data := self.read():
                received += data
                last = time.monotonic()
        return bytes(received)

    def set_dtr(self, on: bool) -> None:
        """Set the DTR line, which stops the motor of an A1; a port without this line ignores it."""
        with suppress(OSError):
            self._serial.dtr = on

    def close(self) -> None:
        """Close the port, also when it was unplugged."""
        with suppress(OSError):
            self._serial.close()

    def _lost(self, error: Exception) -> DriverError:
        return DriverError(f"{self.port}: the connection broke off ({error}): check the cable")
