"""Options that the commands about scanners share."""

from pathlib import Path
from typing import Annotated

import typer

DEFAULT_SCANNER = "rplidar"
"""Value of --scanner where it is not given; a name of ``drivers.scanners.SCANNERS``."""

ScannerName = Annotated[str, typer.Option("--scanner", help="Kind of scanner.")]
Port = Annotated[
    str | None, typer.Option("--port", help="Serial port; default: the first with a scanner.", show_default=False)
]
Mode = Annotated[
    str | None, typer.Option("--mode", help="Scan mode by its name; default: the typical one.", show_default=False)
]
Rpm = Annotated[int | None, typer.Option("--rpm", min=1, help="Speed of an S-series scanner; default: 600.")]
Baud = Annotated[int | None, typer.Option("--baud", min=1, help="Speed of the link; default: detected.")]
Odometry = Annotated[
    str | None,
    typer.Option(
        "--odometry",
        help="Where another program writes wheel odometry, lines `stamp x y theta` [s since 1970, m, rad]: a FIFO or a "
        "file; - for the standard input. Default: none, the motion comes from the scans alone.",
        show_default=False,
    ),
]
Limit = Annotated[int | None, typer.Option("--limit", min=1, help="Stop after so many scans.", show_default=False)]
View = Annotated[bool, typer.Option("--view", help="Show the growing map, in a window or in a browser.")]
ViewFile = Annotated[
    Path | None,
    typer.Option("--view-file", help="Write what --view would show, for `rerun FILE`.", show_default=False),
]
