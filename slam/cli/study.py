"""The commands ``cwlf-slam study``; heavy imports wait for the command that needs them."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slam.cli.options import EffectsOption, OdometryOption, People, SimulatedSensor, check_simulated

if TYPE_CHECKING:
    from distributed import Client
    from pydantic import BaseModel

study = typer.Typer(
    name="study",
    help="Monte Carlo with the truth beside: the paper's tables and figures, and the whole of SLAM. What is cut short "
    "goes on where it was when the same command is given again.",
    no_args_is_help=True,
    add_completion=False,
)

Out = Annotated[Path | None, typer.Option("--out", help="Run folder; default runs/<study>-<date>.", show_default=False)]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write into the run folder although it is not empty.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of all that is random.")]
SigmaRange = Annotated[float, typer.Option("--sigma-range-mm", min=0.001, help="Standard deviation of a range [mm].")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler", help="Dask scheduler to use, tcp://host:port; see docs/scaling.md.", show_default=False
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Processes on this machine; default: one a core.", show_default=False),
]


@study.command()
def corners(
    environment: Annotated[
        Literal["A", "B", "room", "random", "cluttered"],
        typer.Option(
            "--environment",
            help="A, B: like the paper's; room: the demo's; random, cluttered: rooms drawn at random, many poses.",
        ),
    ],
    scans: Annotated[int, typer.Option("--scans", min=1, help="Noisy scans; all methods see the same.")] = 1000,
    rooms: Annotated[
        int | None,
        typer.Option(
            "--rooms", min=1, help="Rooms drawn; default: 20 random or 40 cluttered ones.", show_default=False
        ),
    ] = None,
    sensor: SimulatedSensor = "rplidar-s1",
    effects: EffectsOption = "off",
    sigma_range_mm: Annotated[
        float | None,
        typer.Option(
            "--sigma-range-mm",
            min=0.001,
            help="Standard deviation of a range [mm]; default: that of the sensor preset.",
            show_default=False,
        ),
    ] = None,
    seed: Seed = 1,
    scheduler: Scheduler = None,
    workers: Workers = None,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Tables I and II: claimed uncertainty of each corner beside its true error, by each method."""
    from slam.study.paper.corners import CornerSettings
    from slam.study.paper.report import study_corners

    check_simulated(sensor)
    chosen = {"sigma_range_mm": sigma_range_mm, "rooms": rooms}
    settings = CornerSettings.model_validate(
        {"environment": environment, "scans": scans, "sensor": sensor, "effects": effects, "seed": seed}
        | {name: value for name, value in chosen.items() if value is not None}
    )
    with _begun("corners", f"corners-{environment}", settings, out, overwrite, scheduler, workers) as (client, folder):
        _print(study_corners(client, folder, settings), folder)


@study.command()
def consistency(
    trials: Annotated[int, typer.Option("--trials", min=2, help="Noisy corners of each setting.")] = 500,
    seed: Seed = 1,
    scheduler: Scheduler = None,
    workers: Workers = None,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Where each covariance holds: NEES/2 and bias over noise, incidence, points, angle and distance."""
    from slam.study.paper.consistency import ConsistencySettings
    from slam.study.paper.report import study_consistency

    settings = ConsistencySettings(trials=trials, seed=seed)
    with _begun("consistency", "consistency", settings, out, overwrite, scheduler, workers) as (client, folder):
        _print(study_consistency(client, folder, settings), folder)


@study.command()
def slam(
    seeds: Annotated[int, typer.Option("--seeds", min=1, help="Simulated runs, each with a seed of its own.")] = 100,
    world: Annotated[
        str,
        typer.Option(
            "--world",
            help="What the robot drives through: name of a built-in world, or file; cluttered-room-* or random-room-*: "
            "another room in each run.",
        ),
    ] = "room",
    sensor: SimulatedSensor = "rplidar-s1",
    sigma_range_mm: Annotated[
        float | None,
        typer.Option(
            "--sigma-range-mm",
            min=0.001,
            help="True standard deviation of a range; the configuration keeps that of the preset, the default [mm].",
            show_default=False,
        ),
    ] = None,
    effects: EffectsOption = "ideal",
    odometry: OdometryOption = "poor",
    people: People = 0,
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file with any of the keys that `cwlf-slam config` prints.")
    ] = None,
    limit: Annotated[
        int | None, typer.Option("--limit", min=1, help="Stop each run after so many scans.", show_default=False)
    ] = None,
    seed: Seed = 1,
    scheduler: Scheduler = None,
    workers: Workers = None,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Run the whole pipeline on simulated runs: errors, NEES, NIS, associations and duplicates against the truth."""
    from slam.study.monte_carlo.report import study_slam
    from slam.study.monte_carlo.runs import EACH, MonteCarloSettings, simulated_run, study_config
    from slam.study.tasks.run import failure_message

    check_simulated(sensor)
    given: dict[str, object] = {"world": world, "sensor": sensor}
    given |= {"effects": effects, "odometry": odometry, "people": people}
    given |= {"seeds": seeds, "scans": limit or 0, "seed": seed, "config": study_config(config, sensor)}
    if sigma_range_mm is not None:
        given["sigma_range_mm"] = sigma_range_mm
    settings = MonteCarloSettings.model_validate(given)
    # What is wrong with the world is told at once, and once.
    name = simulated_run(settings, seed).name
    name = world.removesuffix(EACH) if world.endswith(EACH) else name
    with _begun("slam", f"slam-{name}", settings, out, overwrite, scheduler, workers) as (client, folder):
        lines, failures = study_slam(client, folder, settings)
        _print(lines, folder)
        if failures:
            typer.echo(f"cwlf-slam: {failure_message(folder, failures, seeds)}", err=True)
            raise typer.Exit(1)


@study.command()
def trust(
    runs: Annotated[int, typer.Option("--runs", min=0, help="Simulated runs without fault.")] = 200,
    faulty: Annotated[
        int, typer.Option("--faulty", min=0, help="Simulated runs with a fault, the faults by turns.")
    ] = 200,
    limit: Annotated[int, typer.Option("--limit", min=2, help="Stop each run after so many scans.")] = 120,
    seed: Seed = 1,
    scheduler: Scheduler = None,
    workers: Workers = None,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Put faults into simulated runs: how many wrong runs are told, and how many right ones are not trusted."""
    from slam.study.tasks.run import failure_message
    from slam.study.trust.report import study_trust
    from slam.study.trust.runs import TrustSettings

    if not runs + faulty:
        raise typer.BadParameter("no run is left: expected at least one with or without fault", param_hint="--runs")
    settings = TrustSettings(runs=runs, faulty=faulty, scans=limit, seed=seed)
    with _begun("trust", "trust", settings, out, overwrite, scheduler, workers) as (client, folder):
        lines, failures = study_trust(client, folder, settings)
        _print(lines, folder)
        if failures:
            typer.echo(f"cwlf-slam: {failure_message(folder, failures, runs + faulty)}", err=True)
            raise typer.Exit(1)


@study.command()
def timing(
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Times each figure is taken; the least counts.")] = 7,
    sigma_range_mm: SigmaRange = 50.0,
    seed: Seed = 1,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Figures 3, 4 and 5: time of a corner against its measurements, step by step; in one process, to measure it."""
    from datetime import datetime

    from slam.run.folder import claimed, default_folder
    from slam.study.paper.report import study_timing
    from slam.study.paper.timing import TimingSettings

    settings = TimingSettings(repeats=repeats, sigma_range_mm=sigma_range_mm, seed=seed)
    with claimed(out or default_folder("timing", datetime.now()), overwrite=overwrite) as folder:
        _print(study_timing(folder, settings), folder)


@study.command()
def paper(
    docs: Annotated[Path, typer.Option("--docs", help="Folder of paper.md.")] = Path("docs"),
    out: Annotated[Path, typer.Option("--out", help="Folder for the run folders of the studies.")] = Path("runs/paper"),
    scheduler: Scheduler = None,
    workers: Workers = None,
) -> None:
    """Run the studies of the paper and put their tables and pictures into docs/paper.md."""
    from slam.study.paper.page import make_page

    _check(scheduler, workers)
    with _interruptible():
        typer.echo("\n".join(make_page(docs, out, scheduler, workers)))


@study.command()
def scaling(
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Times that one worker and all are timed.")] = 20,
    docs: Annotated[Path, typer.Option("--docs", help="Folder of scaling.md.")] = Path("docs"),
    out: Annotated[Path, typer.Option("--out", help="Folder for what is timed.")] = Path("runs/scaling"),
) -> None:
    """Time the runs of `study slam` on one worker and on all cores, and put the figures into docs/scaling.md."""
    from slam.study.monte_carlo.scaling import make_scaling_page

    typer.echo("\n".join(make_scaling_page(docs, out, rounds)))


@contextmanager
def _begun(
    kind: str,
    name: str,
    settings: BaseModel,
    out: Path | None,
    overwrite: bool,
    scheduler: str | None,
    workers: int | None,
) -> Generator[tuple[Client, Path]]:
    """Workers and folder of a study; its finished tasks stay in the folder unless it comes to its end."""
    from slam.study.tasks.folder import study_folder
    from slam.study.tasks.journal import discard, identity
    from slam.study.tasks.run import pool

    _check(scheduler, workers)
    owner = identity(kind, settings)
    with _interruptible(), study_folder(name, owner, out, overwrite=overwrite) as folder:
        with pool(scheduler, workers) as client:
            yield client, folder
        discard(folder)


def _check(scheduler: str | None, workers: int | None) -> None:
    if scheduler is not None and workers is not None:
        raise typer.BadParameter("a scheduler has its own workers; drop --workers", param_hint="--scheduler")


@contextmanager
def _interruptible() -> Generator[None]:
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("cwlf-slam: interrupted; the same command goes on where it was", err=True)
        raise typer.Exit(130) from None


def _print(lines: list[str], folder: Path) -> None:
    typer.echo("\n".join([*lines, f"run folder: {folder}"]))
