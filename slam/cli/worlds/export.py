"""The command ``cwlf-slam export``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from slam.cli.options import LOG, OdomTopic, ScanTopic


def export(
    log: Annotated[Path, typer.Argument(help=LOG, show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="File to write, gzipped if it ends with .gz.", show_default=False)],
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    to: Annotated[Literal["carmen"], typer.Option("--format", help="Format of that file.")] = "carmen",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write a recording, or a ROS bag, as a log that other programs read; a CARMEN log holds no truth."""
    from drivers.carmen.export import write_carmen
    from drivers.errors import RecordError
    from drivers.open_log import open_log
    from slam.config_file import load_config

    if out.exists() and not overwrite:
        raise RecordError(f"{out} is there already: choose another name or give --overwrite")
    source = open_log(log, scan_topic=scan_topic, odom_topic=odom_topic)
    if not source.has_odometry:
        typer.echo(
            "cwlf-slam: a CARMEN log cannot say that there is no odometry, all its poses are the origin: "
            'run it with source = "lines" in [odometry]',
            err=True,
        )
    sensor = load_config(None, source=source.info).sensor
    write_carmen(out, source, source.mounting, sensor.range_max_m)
    typer.echo(f"{to}: {out}")
