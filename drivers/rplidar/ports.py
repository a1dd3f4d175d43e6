"""Searches the serial ports of this computer for scanners."""

from collections.abc import Iterable, Iterator
from threading import Event

from serial.tools import list_ports

from drivers.errors import DriverError
from drivers.rplidar.device import Device
from drivers.rplidar.protocol.link import LinkClosedError

NO_PORT = (
    "no USB serial port is there: plug the scanner in with its USB adapter, and give it power; "
    "a port that is not on USB is named with --port"
)


def serial_ports() -> list[str]:
    """Names of the serial ports on USB; others are not searched, as this would write to devices of other kinds."""
    return sorted(port.device for port in list_ports.comports() if port.vid is not None)


def find_devices(ports: Iterable[str], closing: Event, baud: int | None = None) -> Iterator[Device | DriverError]:
    """Open each port in turn, and yield the scanner on it or the reason why there is none."""
    for port in ports:
        try:
            yield Device(port, closing, baud)
        except LinkClosedError:
            raise
        except DriverError as error:
            yield error


def find_device(port: str | None, closing: Event, baud: int | None = None) -> Device:
    """Open the scanner on a port; for None, on the first port with a scanner.

    Raises
    ------
    DriverError
        There is none.
    """
    ports = serial_ports() if port is None else [port]
    if not ports:
        raise DriverError(NO_PORT)
    reasons: list[str] = []
    for found in find_devices(ports, closing, baud):
        if isinstance(found, Device):
            return found
        reasons.append(str(found))
    raise DriverError("; ".join(reasons))
