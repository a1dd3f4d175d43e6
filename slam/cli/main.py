"""The command ``cwlf-slam``; heavy imports wait for the command that needs them."""

from __future__ import annotations

import gc
import logging
import os
import sys
from typing import Annotated

import typer

from slam.cli.config import show_config
from slam.cli.demo import demo
from slam.cli.evaluate import evaluate
from slam.cli.extract import extract_scan
from slam.cli.run import run
from slam.cli.scanner.devices import devices
from slam.cli.scanner.emulate import emulate
from slam.cli.scanner.live import live
from slam.cli.scanner.record import record
from slam.cli.scanner.replay import replay
from slam.cli.study import study
from slam.cli.worlds.export import export
from slam.cli.worlds.simulate import simulate
from slam.cli.worlds.world import world

app = typer.Typer(
    name="cwlf-slam",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Run the command line: errors in the data, and output that is full, become one line on stderr and exit code 1."""
    # The matrices are small: threads of the linear algebra would wait for each other. Read when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Of the libraries alone hundreds of thousands of objects stay: to look through them for garbage takes a second.
    gc.set_threshold(50_000)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s", stream=sys.stderr)
    logging.getLogger("features.compiled").setLevel(logging.INFO)
    logging.captureWarnings(capture=True)
    try:
        app()
    except OSError as error:
        # Of files that a command opens itself come errors of ours; this is the standard output.
        typer.echo(f"cwlf-slam: {error}", err=True)
        # What is left in the buffer cannot be written either: Python would try again at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except Exception as error:
        from features.errors import CwlfError

        if not isinstance(error, CwlfError):
            raise
        typer.echo(f"cwlf-slam: {error}", err=True)
        sys.exit(1)


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        typer.echo(f"cwlf-slam {version('cwlf-slam')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """2D-lidar landmark SLAM on CWLF corners: a log in, a trajectory and a landmark map out."""


app.command()(demo)
app.command()(run)
app.command()(evaluate)
app.command("config")(show_config)
app.command("extract")(extract_scan)
app.command()(simulate)
app.command()(devices)
app.command()(emulate)
app.command()(live)
app.command()(record)
app.command()(replay)
app.command()(export)
app.add_typer(world)
app.add_typer(study)


if __name__ == "__main__":
    main()
