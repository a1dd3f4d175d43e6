"""The command ``cwlf-slam extract``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slam.cli.options import LOG, Config, OdomTopic, ScanTopic, Sensor


def extract_scan(
    log: Annotated[Path, typer.Argument(help=LOG, show_default=False)],
    scan: Annotated[int, typer.Option("--scan", min=0, help="Number of the scan, the first is 0.", show_default=False)],
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    plot: Annotated[Path | None, typer.Option("--plot", help="PNG file to draw.", show_default=False)] = None,
    sensor: Sensor = None,
    config: Config = None,
) -> None:
    """Show the lines and corners of one scan of a log."""
    from dataclasses import replace

    from drivers.open_log import open_log
    from slam.config_file import load_config
    from slam.study.one_scan import feature_lines, scan_features

    source = open_log(log, scan_topic=scan_topic, odom_topic=odom_topic)
    # Odometry is of no use here: a configuration that asks for it is no error.
    effective = load_config(config, preset=sensor, source=replace(source.info, has_odometry=True))
    taken, features = scan_features(source, scan, effective)
    typer.echo("\n".join(feature_lines(taken, features)))
    if plot is not None:
        from slam.pictures.scan import draw_scan

        draw_scan(plot, f"{source.name}, scan {scan}", taken, features, effective.sensor.range_max_m)
        typer.echo(f"picture: {plot}")
