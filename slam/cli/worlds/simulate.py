"""The command ``cwlf-slam simulate``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slam.cli.options import EffectsOption, OdometryOption, People, SimulatedSensor, check_simulated


def simulate(
    world_name: Annotated[str, typer.Option("--world", help="Name of a built-in world, or file.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="Recording to write, such as drive.jsonl.gz.", show_default=False)],
    path: Annotated[
        Path | None,
        typer.Option("--path", help="Waypoints: lines x,y or JSON; default: the world's path.", show_default=False),
    ] = None,
    sensor: SimulatedSensor = "rplidar-s1",
    effects: EffectsOption = "ideal",
    odometry: OdometryOption = "poor",
    people: People = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all that is random.")] = 1,
    may_be_open: Annotated[bool, typer.Option("--open", help="Drive although outlines are not closed.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Drive a robot through a world; record what it measures, and the truth."""
    from drivers.recording.recorder import Recorder
    from sim.motion.odometry_presets import ODOMETRIES
    from sim.motion.waypoints import read_waypoints
    from sim.scenarios import site_run
    from sim.sensing.effects import effects_of
    from sim.sensing.lidar import Lidar
    from sim.worlds.catalogue import find_site
    from slam.run.interrupt import Interrupt
    from slam.run.progress_bar import ProgressBar

    check_simulated(sensor)
    lidar = Lidar.of_preset(sensor, effects=effects_of(effects, sensor))
    site = find_site(world_name)
    waypoints = None if path is None else read_waypoints(path)
    source = site_run(
        site,
        lidar,
        sensor,
        seed,
        waypoints,
        odometry=ODOMETRIES[odometry],
        people=people,
        may_be_open=may_be_open,
    )
    recorder = Recorder(
        out,
        source.info,
        walls=source.world.walls,
        glass=source.world.glass,
        overwrite=overwrite,
    )
    scans, seconds = 0, 0.0
    with Interrupt() as interrupt, ProgressBar(source.name) as progress, recorder:
        for frame, truth in zip(source, source.poses_world_robot, strict=True):
            recorder.write(frame, truth)
            scans, seconds = scans + (frame.scan is not None), frame.stamp
            progress.update(source.progress, scans)
            if interrupt.requested:
                break
    typer.echo(f"{scans} scans, {seconds:.0f} s of data")
    typer.echo(f"recording: {out}")
    if interrupt.requested:
        typer.echo("cwlf-slam: interrupted; the recording holds what was done so far", err=True)
        raise typer.Exit(130)
