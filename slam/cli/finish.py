"""The end of every command that runs SLAM: the folder is written, and what is in it said."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from features.errors import CwlfError
    from slam.result.result import SlamResult


def save(folder: Path, title: str, result: SlamResult, error: CwlfError | None) -> None:
    """Write the run folder and say what is in it.

    Raises
    ------
    CwlfError
        The source broke: its error, with the folder of what came before.
    """
    from slam.run.folder import save_run
    from slam.run.interrupt import Interrupt

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
    if metrics.noise is not None:
        typer.echo(metrics.noise.sentence)
    for reason in metrics.trust.reasons:
        typer.echo(f"not to be trusted: {reason.sentence} (from {reason.stamp:.3f} s until {reason.until:.3f} s)")
    typer.echo(f"run folder: {folder}")


def leave(result: SlamResult) -> None:
    """Leave with exit code 130 where the run was interrupted."""
    if result.metrics.interrupted:
        typer.echo("cwlf-slam: interrupted; the run folder holds what was done so far", err=True)
        raise typer.Exit(130)
