"""The command ``cwlf-slam run``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slam.cli.finish import leave, save
from slam.cli.options import LOG, Config, OdomTopic, Out, Overwrite, ScanTopic, Sensor

if TYPE_CHECKING:
    from slam.config import SlamConfig

VICTORIA_PARK = Path("victoria-park")
"""A data set by its name instead of its path."""


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

    from drivers.open_log import open_log
    from drivers.subsampling import Subsampled
    from slam.config import without_identities
    from slam.config_file import check_same, load_config
    from slam.pipeline import Slam
    from slam.run.checkpoint import LogPosition, discard_checkpoint, read_checkpoint
    from slam.run.folder import claimed, default_folder
    from slam.run.progress_bar import ProgressBar
    from slam.run.session import Session

    if resume and (out is None or overwrite):
        raise typer.BadParameter("give the stopped run with --out, and no --overwrite", param_hint="--resume")
    path = _victoria_park() if log == VICTORIA_PARK and not log.exists() else log
    source = Subsampled(open_log(path, scan_topic=scan_topic, odom_topic=odom_topic), every, skip)

    def asked() -> SlamConfig:
        given = load_config(config, preset=sensor, source=source.info, seed=seed)
        return without_identities(given) if ignore_identities else given

    if out is not None and resume:
        slam, position = read_checkpoint(out)
        if config is not None or sensor is not None or seed is not None or ignore_identities:
            check_same(slam.config, asked(), f"{out}: the stopped run")
    else:
        slam, position = Slam(asked()), LogPosition(source.name)
    with claimed(out or default_folder(source.name, datetime.now()), overwrite=overwrite or resume) as folder:
        if not resume:
            discard_checkpoint(folder)
        result, error = Session(slam, position, ProgressBar(source.name), folder).run(source, limit)
        save(folder, source.name, result, error)
    leave(result)


def _victoria_park() -> Path:
    """Find the data set in GTSAM's package, without the time that it takes to import it."""
    from importlib.util import find_spec

    package = find_spec("gtsam")
    return Path(next(iter(package.submodule_search_locations or [])) if package else ".", "Data", "victoria_park.txt")
