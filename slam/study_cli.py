"""The commands ``cwlf-slam study`` and ``cwlf-slam extract``; heavy imports wait for the command that needs them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

study = typer.Typer(
    name="study",
    help="Tables and figures of the paper, with the true errors beside what is claimed.",
    no_args_is_help=True,
    add_completion=False,
)

Out = Annotated[Path | None, typer.Option("--out", help="Run folder; default runs/<study>-<date>.", show_default=False)]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write into the run folder although it is not empty.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of all that is random.")]
SigmaRange = Annotated[float, typer.Option("--sigma-range-mm", min=0.001, help="Standard deviation of a range [mm].")]


@study.command()
def corners(
    environment: Annotated[
        Literal["A", "B", "room", "random"],
        typer.Option("--environment", help="A, B: like the paper's; room: the demo's; random: 20 rooms, many poses."),
    ],
    scans: Annotated[int, typer.Option("--scans", min=1, help="Noisy scans; all methods see the same.")] = 1000,
    sigma_range_mm: SigmaRange = 20.0,
    seed: Seed = 1,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Tables I and II: claimed uncertainty of each corner beside its true error, by each method."""
    from datetime import datetime

    from slam.run_folder import claimed, default_folder
    from slam.study.corners import CornerSettings
    from slam.study.report import study_corners

    settings = CornerSettings(environment=environment, scans=scans, sigma_range_mm=sigma_range_mm, seed=seed)
    with claimed(out or default_folder(f"corners-{environment}", datetime.now()), overwrite=overwrite) as folder:
        _print(study_corners(folder, settings), folder)


@study.command()
def consistency(
    trials: Annotated[int, typer.Option("--trials", min=2, help="Noisy corners of each setting.")] = 500,
    seed: Seed = 1,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Where each covariance holds: NEES/2 and bias over noise, incidence, points, angle and distance."""
    from datetime import datetime

    from slam.run_folder import claimed, default_folder
    from slam.study.consistency import ConsistencySettings
    from slam.study.report import study_consistency

    with claimed(out or default_folder("consistency", datetime.now()), overwrite=overwrite) as folder:
        _print(study_consistency(folder, ConsistencySettings(trials=trials, seed=seed)), folder)


@study.command()
def timing(
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Times each figure is taken; the least counts.")] = 7,
    sigma_range_mm: SigmaRange = 50.0,
    seed: Seed = 1,
    out: Out = None,
    overwrite: Overwrite = False,
) -> None:
    """Figures 3, 4 and 5: time of a corner against its measurements, time and uncertainty step by step."""
    from datetime import datetime

    from slam.run_folder import claimed, default_folder
    from slam.study.report import study_timing
    from slam.study.timing import TimingSettings

    settings = TimingSettings(repeats=repeats, sigma_range_mm=sigma_range_mm, seed=seed)
    with claimed(out or default_folder("timing", datetime.now()), overwrite=overwrite) as folder:
        _print(study_timing(folder, settings), folder)


@study.command()
def paper(
    docs: Annotated[Path, typer.Option("--docs", help="Folder of paper.md.")] = Path("docs"),
    out: Annotated[Path, typer.Option("--out", help="Folder for the run folders of the studies.")] = Path("runs/paper"),
) -> None:
    """Run all studies and put their tables and pictures into docs/paper.md."""
    from slam.study.page import make_page

    typer.echo("\n".join(make_page(docs, out)))


def extract_scan(
    log: Annotated[Path, typer.Argument(help="Recording, or CARMEN log.", show_default=False)],
    scan: Annotated[int, typer.Option("--scan", min=0, help="Number of the scan, the first is 0.", show_default=False)],
    plot: Annotated[Path | None, typer.Option("--plot", help="PNG file to draw.", show_default=False)] = None,
    sensor: Annotated[
        str | None,
        typer.Option("--sensor", help="Sensor preset: rplidar-s1 or sick-lms; default: the log's.", show_default=False),
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="TOML file with any of the keys that `cwlf-slam config` prints.")
    ] = None,
) -> None:
    """Show the lines and corners of one scan of a log."""
    from drivers.open_log import open_log
    from slam.config import load_config
    from slam.study.one_scan import feature_lines, scan_features

    source = open_log(log)
    effective = load_config(config, preset=sensor, source_preset=source.sensor, source_mounting=source.mounting)
    taken, features = scan_features(source, scan, effective)
    typer.echo("\n".join(feature_lines(taken, features)))
    if plot is not None:
        from slam.study.one_scan_plot import draw_scan

        draw_scan(plot, f"{source.name}, scan {scan}", taken, features, effective.sensor.range_max_m)
        typer.echo(f"picture: {plot}")


def _print(lines: list[str], folder: Path) -> None:
    typer.echo("\n".join([*lines, f"run folder: {folder}"]))
