"""The commands ``cwlf-slam world``, ``simulate`` and ``export``; heavy imports wait for the command that needs them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from slam.cli.options import LOG, OdomTopic, ScanTopic

if TYPE_CHECKING:
    from sim.worlds.site import Site

world = typer.Typer(
    name="world",
    help="Worlds for the simulator: those built in, and files (JSON, SDF, YAML of a ROS map, DXF).",
    no_args_is_help=True,
    add_completion=False,
)

EffectsOption = Annotated[
    Literal["ideal", "rplidar-s1", "sick-lms"],
    typer.Option(
        "--effects",
        help="What the scanner does beside the noise of the paper, such as motion during a sweep, mixed pixels, lost "
        "beams, glass and steps: that of a sensor, or ideal, nothing.",
    ),
]
OdometryOption = Annotated[
    Literal["exact", "good", "poor", "slipping"], typer.Option("--odometry", help="Errors of the wheels.")
]
People = Annotated[int, typer.Option("--people", min=0, help="People who go to and fro beside the path.")]
Name = Annotated[str, typer.Argument(help="Name of a built-in world, or file.", show_default=False)]


@world.command("list")
def list_worlds() -> None:
    """Name the built-in worlds, with their size, walls, corners and path."""
    from sim.worlds.sites import BUILT_IN, find_site

    for name in (*BUILT_IN, "random-room-1"):
        typer.echo(_summary(find_site(name)))


@world.command()
def show(
    name: Name,
    out: Annotated[
        Path | None, typer.Option("--out", help="PNG file; default runs/world-<name>.png.", show_default=False)
    ] = None,
) -> None:
    """Draw a world: walls, corners and the path, where it has one."""
    from sim.worlds.sites import find_site
    from slam.pictures.world import draw_world

    site = find_site(name)
    picture = out or Path("runs") / f"world-{site.name}.png"
    draw_world(picture, site, site.world())
    typer.echo(_summary(site))
    typer.echo(f"picture: {picture}")


@world.command()
def check(name: Name) -> None:
    """List what is wrong with a world, a line each with its coordinates; exit code 1 if there is anything."""
    from sim.worlds.check import findings
    from sim.worlds.sites import find_site

    site = find_site(name)
    found = findings(site.walls)
    for line in found:
        typer.echo(line)
    typer.echo(f"{site.name}: {len(site.walls)} walls, {len(found) or 'nothing'} wrong")
    if found:
        raise typer.Exit(1)


def simulate(
    world_name: Annotated[str, typer.Option("--world", help="Name of a built-in world, or file.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="Recording to write, such as drive.jsonl.gz.", show_default=False)],
    path: Annotated[
        Path | None,
        typer.Option("--path", help="Waypoints: lines x,y or JSON; default: the world's path.", show_default=False),
    ] = None,
    sensor: Annotated[str, typer.Option("--sensor", help="Sensor preset: rplidar-s1 or sick-lms.")] = "rplidar-s1",
    effects: EffectsOption = "ideal",
    odometry: OdometryOption = "poor",
    people: People = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of all that is random.")] = 1,
    may_be_open: Annotated[bool, typer.Option("--open", help="Drive although outlines are not closed.")] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Drive a robot through a world; record what it measures, and the truth."""
    from drivers.recording.recorder import Recorder
    from sim.motion.waypoints import read_waypoints
    from sim.run import ODOMETRIES
    from sim.sensing.effects import EFFECTS
    from sim.sensing.lidar import Lidar
    from sim.site_run import site_run
    from sim.worlds.sites import find_site
    from slam.errors import ConfigError
    from slam.run.interrupt import Interrupt
    from slam.run.progress_bar import ProgressBar

    try:
        lidar = Lidar.of_preset(sensor, effects=EFFECTS[effects])
    except ValueError as error:
        raise ConfigError(f"--sensor: {error}") from None
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


def export(
    log: Annotated[Path, typer.Argument(help=LOG, show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="File to write, gzipped if it ends with .gz.", show_default=False)],
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    to: Annotated[Literal["carmen"], typer.Option("--format", help="Format of that file.")] = "carmen",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write a recording, or a ROS bag, as a log that other programs read; a CARMEN log holds no truth."""
    from drivers.carmen.export import write_carmen
    from drivers.errors import RecordError
    from drivers.open_log import open_log
    from slam.config_file import load_config

    if out.exists() and not overwrite:
        raise RecordError(f"{out} is there already: choose another name or give --overwrite")
    source = open_log(log, scan_topic=scan_topic, odom_topic=odom_topic)
    if not source.has_odometry:
        typer.echo(
            "cwlf-slam: a CARMEN log cannot say that there is no odometry, all its poses are the origin: "
            'run it with source = "lines" in [odometry]',
            err=True,
        )
    sensor = load_config(None, source=source.info).sensor
    write_carmen(out, source, source.mounting, sensor.range_max_m)
    typer.echo(f"{to}: {out}")


def _summary(site: Site) -> str:
    """Size, walls, corners and path of a world in a line."""
    import numpy as np

    world = site.world()
    width, height = np.ptp(world.walls.reshape(-1, 2), axis=0)
    way = "no path" if site.waypoints is None else f"path of {np.hypot(*np.diff(site.waypoints, axis=0).T).sum():.0f} m"
    return (
        f"{site.name:16s} {width:.1f} m x {height:.1f} m, {len(world.walls)} walls, {len(world.corners)} corners, {way}"
    )
