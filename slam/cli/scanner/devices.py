"""The command ``cwlf-slam devices``; heavy imports wait until it runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from slam.cli.scanner.options import DEFAULT_SCANNER, ScannerName

if TYPE_CHECKING:
    from drivers.errors import DriverError


def devices(
    port: Annotated[
        list[str] | None,
        typer.Option("--port", help="Port to search; may be repeated; default: all on USB.", show_default=False),
    ] = None,
    scanner: ScannerName = DEFAULT_SCANNER,
) -> None:
    """List the scanners on serial ports: model, serial number, speed and scan modes; stops those that scan."""
    from drivers.errors import DriverError
    from drivers.scanners import find_scanner

    found = 0
    reasons: list[DriverError] = []
    for description in find_scanner(scanner).discover(port or ()):
        if isinstance(description, DriverError):
            reasons.append(description)
        else:
            found += 1
            typer.echo(description)
    if not found and len(reasons) == 1:
        raise reasons[0]
    for reason in reasons:
        typer.echo(str(reason))
    if not found:
        raise DriverError("no scanner was found" + (": each line above says why" if reasons else ""))
