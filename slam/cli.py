"""The command ``cwlf-slam``; heavy imports wait for the command that needs them."""

from __future__ import annotations

import gc
import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slam.cli_options import LOG, Config, OdomTopic, Out, Overwrite, ScanTopic, Sensor
from slam.device_cli import devices
from slam.emulate_cli import emulate
from slam.finish_cli import leave, save
from slam.live_cli import live, record, replay
from slam.study_cli import extract_scan, study
from slam.world_cli import export, simulate, world

if TYPE_CHECKING:
    from slam.config import SlamConfig

app = typer.Typer(
    name="cwlf-slam",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

VICTORIA_PARK = Path("victoria-park")
"""A data set by its name instead of its path."""

Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


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


@app.command()
def demo(
    out: Out = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Drive a simulated robot with poor odometry through a room, map it and compare with the truth."""
    from dataclasses import replace
    from datetime import datetime

    from sim.run import room_run
    from slam.checkpoint import Stand
    from slam.config_file import load_config
    from slam.evaluate import evaluate_simulated
    from slam.pipeline import Slam
    from slam.run_folder import claimed, default_folder
    from slam.session import Session

    source = room_run(seed)
    config = load_config(None, source_preset=source.sensor, source_mounting=source.mounting, seed=seed)
    with claimed(out or default_folder("demo", datetime.now()), overwrite=overwrite) as folder:
        result, error = Session(Slam(config), Stand(source.name)).run(source)
        evaluation = evaluate_simulated(source, result)
        metrics = replace(result.metrics, ate_rmse_m=evaluation.ate_rmse_m, landmark_rmse_m=evaluation.landmark_rmse_m)
        save(folder, "Simulated room", replace(result, metrics=metrics), error)
    rmse = evaluation.landmark_rmse_m
    typer.echo(
        f"ATE {evaluation.ate_rmse_m:.4f} m (wheels alone {evaluation.wheels_ate_rmse_m:.3f} m), "
        f"landmark RMSE {'unknown' if rmse is None else f'{rmse:.4f} m'}, "
        f"{evaluation.corners_mapped} of {evaluation.corners} corners of the room on the map"
    )
    leave(result)


@app.command()
def run(
    log: Annotated[
        Path,
        typer.Argument(help=LOG, show_default=False),
    ],
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    sensor: Sensor = None,
    config: Config = None,
    out: Out = None,
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Stop after so many scans.")] = None,
    every: Annotated[int, typer.Option("--every", min=1, help="Use every N-th scan; odometry is used in full.")] = 1,
    skip: Annotated[float, typer.Option("--skip", min=0.0, help="Leave out so many seconds at the beginning.")] = 0.0,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of what is random in a run; default: the configuration's.")
    ] = None,
    ignore_identities: Annotated[
        bool, typer.Option("--ignore-identities", help="Associate observed landmarks although the source knows them.")
    ] = False,
    overwrite: Overwrite = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the stopped run in the folder of --out.")
    ] = False,
) -> None:
    """Process a recorded log into a run folder: trajectory, landmarks, metrics, configuration and map."""
    from datetime import datetime

    from drivers.excerpt import Excerpt
    from drivers.open_log import open_log
    from slam.checkpoint import Stand, discard_checkpoint, read_checkpoint
    from slam.config import without_identities
    from slam.config_file import check_same, load_config
    from slam.pipeline import Slam
    from slam.run_folder import claimed, default_folder
    from slam.session import Session

    if resume and (out is None or overwrite):
        raise typer.BadParameter("give the stopped run with --out, and no --overwrite", param_hint="--resume")
    path = _victoria_park() if log == VICTORIA_PARK and not log.exists() else log
    source = Excerpt(open_log(path, scan_topic=scan_topic, odom_topic=odom_topic), every, skip)

    def asked() -> SlamConfig:
        given = load_config(
            config,
            preset=sensor,
            source_preset=source.sensor,
            source_mounting=source.mounting,
            source_odometry=source.has_odometry,
            seed=seed,
        )
        return without_identities(given) if ignore_identities else given

    if out is not None and resume:
        slam, stand = read_checkpoint(out)
        if config is not None or sensor is not None or seed is not None or ignore_identities:
            check_same(slam.config, asked(), f"{out}: the stopped run")
    else:
        slam, stand = Slam(asked()), Stand(source.name)
    with claimed(out or default_folder(source.name, datetime.now()), overwrite=overwrite or resume) as folder:
        if not resume:
            discard_checkpoint(folder)
        result, error = Session(slam, stand, folder).run(source, limit)
        save(folder, source.name, result, error)
    leave(result)


@app.command()
def evaluate(
    run: Annotated[Path, typer.Argument(help="Run folder.", show_default=False)],
    relations: Annotated[
        Path | None, typer.Option("--relations", help="True relations of pairs of poses (Freiburg benchmark).")
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth", help="True trajectory (TUM, or lines `stamp x y theta`), the recording, or the MRCLAM data set."
        ),
    ] = None,
    which: Annotated[
        Literal["final", "online", "odometry"],
        typer.Option(
            "--trajectory", help="The solved one, the filter's as it was live, or odometry's without landmarks."
        ),
    ] = "final",
    as_json: Json = False,
) -> None:
    """Compare the trajectory of a run with relations or with a true trajectory."""
    from slam.evaluate import evaluate_relations, evaluate_truth, to_lines
    from slam.run_folder import read_landmarks, read_trajectory

    if relations is None and truth is None:
        raise typer.BadParameter("give --relations FILE or --truth FILE", param_hint="evaluate")
    trajectory = read_trajectory(run, which)
    report: dict[str, dict[str, float]] = {}
    if relations is not None:
        report |= evaluate_relations(relations, trajectory)
    if truth is not None:
        report |= evaluate_truth(truth, trajectory, *read_landmarks(run))
    if as_json:
        import json

        typer.echo(json.dumps(report))
    else:
        typer.echo("\n".join(to_lines(report)))


@app.command("config")
def show_config(sensor: Sensor = None, config: Config = None) -> None:
    """Print the effective configuration as TOML, each value with its meaning and unit."""
    from slam.config_file import load_config, to_toml

    typer.echo(to_toml(load_config(config, preset=sensor)), nl=False)


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


def _victoria_park() -> Path:
    """Find the data set in GTSAM's package, without the time that it takes to import it."""
    from importlib.util import find_spec

    package = find_spec("gtsam")
    return Path(next(iter(package.submodule_search_locations or [])) if package else ".", "Data", "victoria_park.txt")


if __name__ == "__main__":
    main()
