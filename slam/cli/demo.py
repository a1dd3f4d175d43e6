"""The command ``cwlf-slam demo``; heavy imports wait until it runs."""

from __future__ import annotations

from typing import Annotated

import typer

from slam.cli.finish import leave, save
from slam.cli.options import Out, Overwrite


def demo(
    out: Out = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the simulation.")] = 1,
    overwrite: Overwrite = False,
) -> None:
    """Drive a simulated robot with poor odometry through a room, map it and compare with the truth."""
    from dataclasses import replace
    from datetime import datetime

    from sim.scenarios import room_run
    from slam.config_file import load_config
    from slam.evaluation.evaluate import evaluate_simulated
    from slam.pipeline import Slam
    from slam.run.checkpoint import LogPosition
    from slam.run.folder import claimed, default_folder
    from slam.run.progress_bar import ProgressBar
    from slam.run.session import Session

    source = room_run(seed)
    config = load_config(None, source=source.info, seed=seed)
    with claimed(out or default_folder("demo", datetime.now()), overwrite=overwrite) as folder:
        result, error = Session(Slam(config), LogPosition(source.name), ProgressBar(source.name)).run(source)
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
