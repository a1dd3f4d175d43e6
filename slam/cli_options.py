"""Options of every command that reads a log."""

from typing import Annotated

import typer

LOG = "CARMEN log (.clf or .log, also gzipped), ROS bag (.bag, .mcap, .db3 or a folder), or recording."

ScanTopic = Annotated[
    str | None,
    typer.Option("--scan-topic", help="Scans of a ROS bag to take; default: the only ones.", show_default=False),
]
OdomTopic = Annotated[
    str | None,
    typer.Option(
        "--odom-topic", help="Odometry of a ROS bag; default: the only one, else tf, else none.", show_default=False
    ),
]
