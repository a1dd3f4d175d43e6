"""The command ``cwlf-slam emulate``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from features.se2 import Array
    from sim.emulator import Device, Ledger
    from sim.motion.true_trajectory import TrueTrajectory

TRUTH_RATE = 50.0
"""True poses per second [Hz]."""


def emulate(
    world_name: Annotated[str, typer.Option("--world", help="Name of a built-in world, or file.", show_default=False)],
    model: Annotated[
        Literal["S1", "A1", "A2", "A3", "S2"], typer.Option("--model", help="RPLIDAR to emulate.", case_sensitive=False)
    ] = "S1",
    path: Annotated[
        Path | None,
        typer.Option("--path", help="Waypoints: lines x,y or JSON; default: the world's path.", show_default=False),
    ] = None,
    laps: Annotated[
        int, typer.Option("--laps", min=1, help="How often to go along the path: there, back, there, and so on.")
    ] = 1,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all that is random.")] = 1,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", "--faults", help="Fault to emulate, or `all`; may be repeated.", show_default=False),
    ] = None,
    link: Annotated[
        Path | None, typer.Option("--link", help="Symbolic link that always leads to the device.", show_default=False)
    ] = None,
    truth: Annotated[
        Path | None,
        typer.Option("--truth", help="Write the true trajectory here at the end (TUM).", show_default=False),
    ] = None,
    may_be_open: Annotated[bool, typer.Option("--open", help="Drive although outlines are not closed.")] = False,
) -> None:
    """Emulate an RPLIDAR on a robot in a simulated world, on a pseudo-terminal, until Ctrl-C.

    The robot starts with the first sample and stops at the end of its path. The device communicates at the baud rate of
    the model. At the end the command prints what was sent, and what each fault destroyed of it.
    """
    from sim.emulator import FAULTS, MODELS, Device, Scene, single_beams
    from sim.emulator.terminal import Terminal
    from sim.motion.waypoints import read_waypoints
    from sim.scenarios import site_run
    from sim.worlds.catalogue import find_site
    from slam.errors import ConfigError
    from slam.run.interrupt import Interrupt

    site = find_site(world_name)
    waypoints = site.waypoints if path is None else read_waypoints(path)
    if waypoints is not None:
        waypoints = _laps(waypoints, laps)
    sensor = f"rplidar-{model.lower()}"
    run = site_run(site, single_beams(sensor), sensor, seed, waypoints, may_be_open=may_be_open)
    names = set(fault or ())
    names = set(FAULTS) if "all" in names else names
    try:
        device = Device(MODELS[model], Scene(run.world, run.lidar, run.trajectory), seed, names)
    except ValueError as error:
        raise ConfigError(f"--fault: {error}") from None

    def say(terminal: str) -> None:
        typer.echo(f"device: {terminal if link is None else link} ({model} at {device.baud} baud)")

    with Interrupt() as interrupt:
        with Terminal(device, link, say) as terminal:
            terminal.serve(lambda: interrupt.requested)
            end = terminal.now
        typer.echo("\n".join(_table(device.ledger)))
        if truth is not None:
            _write_truth(truth, run.trajectory, device, terminal.started, end)
            typer.echo(f"truth: {truth}")


def _laps(waypoints: Array, laps: int) -> Array:
    """Waypoints there, back, there, and so on, shape (n, 2) [m]."""
    import numpy as np

    return np.vstack([waypoints, *((waypoints[-2::-1], waypoints[1:])[k % 2] for k in range(laps - 1))])


def _table(ledger: Ledger) -> Iterator[str]:
    """Yield the lines of the table of what was sent and what was lost."""
    yield f"{'sent':16s} {ledger.packets:,} packets, {ledger.samples:,} samples, {ledger.revolutions:,} revolutions"
    columns = ("events", "bytes", "packets", "debris", "samples", "revolutions")
    if ledger.losses:
        yield f"{'lost to':16s}" + "".join(f"{column:>12s}" for column in columns)
    for cause, loss in sorted(ledger.losses.items()):
        yield f"{cause:16s}" + "".join(f"{getattr(loss, column):12,}" for column in columns)


def _write_truth(path: Path, trajectory: TrueTrajectory, device: Device, started: float, end: float) -> None:
    """Write the poses of the robot at the times of the host; it stands still before its departure.

    Raises
    ------
    RecordError
        The file cannot be written.
    """
    import numpy as np

    from drivers.errors import RecordError
    from slam.result.trajectory import Trajectory
    from slam.result.trajectory_file import write_tum

    times = np.arange(0.0, end, 1.0 / TRUTH_RATE)
    departure = end if device.departure is None else device.departure
    try:
        write_tum(path, Trajectory(started + times, trajectory.at(times - departure)))
    except OSError as error:
        raise RecordError(f"{path} cannot be written: {error.strerror}") from None
