"""The command ``cwlf-slam evaluate``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer


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
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare the trajectory of a run with relations or with a true trajectory."""
    from slam.evaluation.evaluate import evaluate_relations, evaluate_truth, to_lines
    from slam.run.folder import read_landmarks, read_trajectory

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
