"""The RPLIDAR as one of the scanners of the command line."""

from collections.abc import Iterator, Mapping, Sequence
from threading import Event
from typing import Any

from drivers.errors import DriverError
from drivers.live_source import LiveOptions, Scanner
from drivers.rplidar.device import Device
from drivers.rplidar.lidar import Rplidar
from drivers.rplidar.ports import NO_PORT, find_devices, serial_ports
from drivers.rplidar.revolutions import RevolutionDecoder, ScanStream


def connect(options: LiveOptions) -> Rplidar:
    """Make the source; it is opened as a context manager."""
    return Rplidar(options.port, mode=options.mode, rpm=options.rpm, baud=options.baud, capacity=options.capacity)


def discover(ports: Sequence[str]) -> Iterator[str | DriverError]:
    """Yield the description of the scanner at each port, or why there is none; a scan that runs is stopped.

    Raises
    ------
    DriverError
        No port is given, and no USB serial port is there.
    """
    ports = ports or serial_ports()
    if not ports:
        raise DriverError(NO_PORT)
    for device in find_devices(ports, Event()):
        if isinstance(device, DriverError):
            yield device
        else:
            description = describe(device)
            device.close()
            yield description


def describe(device: Device) -> str:
    """Model, serial number, firmware and speed, and a line for each scan mode."""
    info = device.info
    major, minor = info.firmware
    modes = [
        f"    {mode.name}: {1e6 / mode.us_per_sample:,.0f} samples/s"
        + (f", up to {mode.max_distance:g} m" if mode.max_distance else "")
        + (" (typical)" if mode == device.typical else "")
        for mode in device.modes
    ]
    head = f"{device.name}: serial number {info.serial}, firmware {major}.{minor:02d}, hardware {info.hardware}"
    return "\n".join([f"{head}, {device.baud} baud", *modes])


def decoder(record: Mapping[str, Any]) -> RevolutionDecoder:
    """Make the decoder of a recorded scan."""
    return RevolutionDecoder(ScanStream.of_record(record))


SCANNER = Scanner(connect, discover, decoder)
