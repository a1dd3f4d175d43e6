"""The command ``cwlf-slam devices``; heavy imports wait until it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from drivers.rplidar.device import Device


def devices(
    port: Annotated[
        list[str] | None,
        typer.Option("--port", help="Port to look at; may be repeated; default: all on USB.", show_default=False),
    ] = None,
) -> None:
    """List the RPLIDARs on serial ports: model, serial number, speed and scan modes; stops those that scan."""
    from threading import Event

    from drivers.errors import DriverError
    from drivers.rplidar.ports import NO_PORT, find_devices, serial_ports

    ports = port or serial_ports()
    if not ports:
        raise DriverError(NO_PORT)
    reasons: list[DriverError] = []
    for device in find_devices(ports, Event()):
        if isinstance(device, DriverError):
            reasons.append(device)
        else:
            typer.echo("\n".join(_lines(device)))
            device.close()
    if len(reasons) == len(ports) == 1:
        raise reasons[0]
    for reason in reasons:
        typer.echo(str(reason))
    if len(reasons) == len(ports):
        raise DriverError("no RPLIDAR is found: each line above says why")


def _lines(device: Device) -> list[str]:
    """Say what a scanner says of itself."""
    info = device.info
    major, minor = info.firmware
    modes = [
        f"    {mode.name}: {1e6 / mode.us_per_sample:,.0f} samples/s"
        + (f", up to {mode.max_distance:g} m" if mode.max_distance else "")
        + (" (typical)" if mode == device.typical else "")
        for mode in device.modes
    ]
    head = f"{device.name}: serial number {info.serial}, firmware {major}.{minor:02d}, hardware {info.hardware}"
    return [f"{head}, {device.baud} baud", *modes]
