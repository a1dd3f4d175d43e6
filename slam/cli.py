"""The command ``cwlf-slam``; heavy imports wait for the command that needs them."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slam.study_cli import extract_scan, study
from slam.world_cli import export, simulate, world

if TYPE_CHECKING:
    from features.errors import CwlfError
    from slam.config import SlamConfig
    from slam.result import SlamResult

app = typer.Typer(
    name="cwlf-slam",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Out = Annotated[Path | None, typer.Option("--out", help="Run folder; default runs/<name>-<date>.", show_default=False)]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write into the run folder although it is not empty.")]
Sensor = Annotated[
    str | None,
    typer.Option("--sensor", help="Sensor preset: rplidar-s1 or sick-lms; default: the source's.", show_default=False),
]
Config = Annotated[
    Path | None,
    typer.Option("--config", help="TOML file with any of the keys that `cwlf-slam config` prints."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def main() -> None:
    """Run the command line: errors in the data, and output that is full, become one line on stderr and exit code 1."""
    # The matrices are small: threads of the linear algebra would wait for each other. Read when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s", stream=sys.stderr)
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
    from slam.config import load_config
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
        _save(folder, "Simulated room", replace(result, metrics=metrics), error)
    rmse = evaluation.landmark_rmse_m
    typer.echo(
        f"ATE {evaluation.ate_rmse_m:.4f} m (wheels alone {evaluation.wheels_ate_rmse_m:.3f} m), "
        f"landmark RMSE {'unknown' if rmse is None else f'{rmse:.4f} m'}, "
        f"{evaluation.corners_mapped} of {evaluation.corners} corners of the room on the map"
    )
    _leave(result)


@app.command()
def run(
    log: Annotated[
        Path, typer.Argument(help="Recording, or CARMEN log (.clf or .log, also gzipped).", show_default=False)
    ],
    sensor: Sensor = None,
    config: Config = None,
    out: Out = None,
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="Stop after so many scans.")] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of what is random in a run; default: the configuration's.")
    ] = None,
    overwrite: Overwrite = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the stopped run in the folder of --out.")
    ] = False,
) -> None:
    """Process a recorded log into a run folder: trajectory, landmarks, metrics, configuration and map."""
    from datetime import datetime

    from drivers.open_log import open_log
    from slam.checkpoint import Stand, discard_checkpoint, read_checkpoint
    from slam.config import check_same, load_config
    from slam.pipeline import Slam
    from slam.run_folder import claimed, default_folder
    from slam.session import Session

    if resume and (out is None or overwrite):
        raise typer.BadParameter("give the stopped run with --out, and no --overwrite", param_hint="--resume")
    source = open_log(log)

    def asked() -> SlamConfig:
        return load_config(
            config, preset=sensor, source_preset=source.sensor, source_mounting=source.mounting, seed=seed
        )

    if out is not None and resume:
        slam, stand = read_checkpoint(out)
        if config is not None or sensor is not None or seed is not None:
            check_same(slam.config, asked(), f"{out}: the stopped run")
    else:
        slam, stand = Slam(asked()), Stand(source.name)
    with claimed(out or default_folder(source.name, datetime.now()), overwrite=overwrite or resume) as folder:
        if not resume:
            discard_checkpoint(folder)
        result, error = Session(slam, stand, folder).run(source, limit)
        _save(folder, source.name, result, error)
    _leave(result)


@app.command()
def evaluate(
    run: Annotated[Path, typer.Argument(help="Run folder.", show_default=False)],
    relations: Annotated[
        Path | None, typer.Option("--relations", help="True relations of pairs of poses (Freiburg benchmark).")
    ] = None,
    truth: Annotated[Path | None, typer.Option("--truth", help="True trajectory (TUM), or the recording.")] = None,
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
        report |= evaluate_truth(truth, trajectory, read_landmarks(run))
    if as_json:
        import json

        typer.echo(json.dumps(report))
    else:
        typer.echo("\n".join(to_lines(report)))


@app.command("config")
def show_config(sensor: Sensor = None, config: Config = None) -> None:
    """Print the effective configuration as TOML, each value with its meaning and unit."""
    from slam.config import load_config, to_toml

    typer.echo(to_toml(load_config(config, preset=sensor)), nl=False)


app.command("extract")(extract_scan)
app.command()(simulate)
app.command()(export)
app.add_typer(world)
app.add_typer(study)


def _save(folder: Path, title: str, result: SlamResult, error: CwlfError | None) -> None:
    from slam.interrupt import Interrupt
    from slam.run_folder import save_run

    with Interrupt():  # a Ctrl-C that comes now finds the folder complete
        save_run(folder, result, title)
    if error is not None:
        raise type(error)(f"{error} (what came before is in {folder})")
    metrics = result.metrics
    typer.echo(
        f"{metrics.scans} scans, {metrics.duration_s:.0f} s of data in {metrics.wall_s:.1f} s "
        f"({metrics.times_real_time:.0f} times real time), {metrics.landmarks} landmarks, "
        f"{metrics.key_frames} key frames"
    )
    for doubt in metrics.trust.reasons:
        typer.echo(f"not to be trusted: {doubt.sentence} (first at {doubt.stamp:.3f} s)")
    typer.echo(f"run folder: {folder}")


def _leave(result: SlamResult) -> None:
    if result.metrics.interrupted:
        typer.echo("cwlf-slam: interrupted; the run folder holds what was done so far", err=True)
        raise typer.Exit(130)


if __name__ == "__main__":
    main()
