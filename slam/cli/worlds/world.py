"""The commands ``cwlf-slam world list``, ``show`` and ``check``; heavy imports wait for the command that needs them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from sim.worlds.site import Site

world = typer.Typer(
    name="world",
    help="Worlds for the simulator: those built in, and files (JSON, SDF, YAML of a ROS map, DXF).",
    no_args_is_help=True,
    add_completion=False,
)

Name = Annotated[str, typer.Argument(help="Name of a built-in world, or file.", show_default=False)]


@world.command("list")
def list_worlds() -> None:
    """Name the built-in worlds, with their size, walls, corners and path."""
    from sim.worlds.catalogue import BUILT_IN, DRAWN, find_site

    for name in (*BUILT_IN, *(f"{name}-1" for name in DRAWN)):
        typer.echo(_summary(find_site(name)))


@world.command()
def show(
    name: Name,
    out: Annotated[
        Path | None, typer.Option("--out", help="PNG file; default runs/world-<name>.png.", show_default=False)
    ] = None,
) -> None:
    """Draw a world: walls, corners and the path, where it has one."""
    from sim.worlds.catalogue import find_site
    from slam.pictures.world import draw_world

    site = find_site(name)
    picture = out or Path("runs") / f"world-{site.name}.png"
    draw_world(picture, site, site.world())
    typer.echo(_summary(site))
    typer.echo(f"picture: {picture}")


@world.command()
def check(name: Name) -> None:
    """List what is wrong with a world, a line each with its coordinates; exit code 1 if there is anything."""
    from sim.worlds.catalogue import find_site
    from sim.worlds.check import findings

    site = find_site(name)
    found = findings(site.walls)
    for line in found:
        typer.echo(line)
    typer.echo(f"{site.name}: {len(site.walls)} walls, {len(found) or 'nothing'} wrong")
    if found:
        raise typer.Exit(1)


def _summary(site: Site) -> str:
    """Size, walls, corners and path of a world in a line."""
    import numpy as np

    world = site.world()
    width, height = np.ptp(world.walls.reshape(-1, 2), axis=0)
    way = "no path" if site.waypoints is None else f"path of {np.hypot(*np.diff(site.waypoints, axis=0).T).sum():.0f} m"
    return (
        f"{site.name:16s} {width:.1f} m x {height:.1f} m, {len(world.walls)} walls, {len(world.corners)} corners, {way}"
    )
