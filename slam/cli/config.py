"""The command ``cwlf-slam config``; heavy imports wait until it runs."""

from __future__ import annotations

import typer

from slam.cli.options import Config, Sensor


def show_config(sensor: Sensor = None, config: Config = None) -> None:
    """Print the effective configuration as TOML, each value with its meaning and unit."""
    from slam.config_file import load_config, to_toml

    typer.echo(to_toml(load_config(config, preset=sensor)), nl=False)
