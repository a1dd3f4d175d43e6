# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of keyword arguments open.
"""Pictures of worlds."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from sim.worlds.site import Site
from sim.worlds.world import World
from slam.errors import RunFolderError
from slam.pictures.run_map import CONCAVE, INK, PATH, WALL

GLASS = "#3fa7b5"
LONGEST = 9.0
"""Longer side of the picture [inch]."""


def draw_world(path: Path, site: Site, world: World) -> None:
    """Draw the walls, the corners and, where there is one, the path.

    Parameters
    ----------
    path : PNG file to write.
    site, world : the walls and the path, and the world that the walls make.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    points = world.walls.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    width, height = high - low
    scale = LONGEST / max(width, height)
    with mpl.rc_context({"font.size": 9, "axes.edgecolor": "#9aa4b2", "axes.labelcolor": INK, "text.color": INK}):
        figure = Figure(figsize=(max(width * scale, 4.0) + 0.8, max(height * scale, 2.0) + 0.8), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        lines = world.walls.reshape(-1, 2, 2)
        for of_glass, color, width_points, name in ((False, WALL, 1.2, "walls"), (True, GLASS, 2.0, "glass")):
            chosen = lines[world.glass == of_glass]
            if len(chosen):
                axes.add_collection(LineCollection(list(chosen), colors=color, linewidths=width_points, label=name))
        axes.plot(*world.corners.T, ".", color=CONCAVE, markersize=3, label="corners")
        if site.waypoints is not None:
            axes.plot(*site.waypoints.T, "-", color=PATH, linewidth=0.8, alpha=0.7, label="path")
            axes.plot(*site.waypoints[0], "o", color=PATH, markersize=5, label="start")
        margin = 0.03 * max(width, height)
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_aspect("equal")
        axes.grid(color="#e3e6ea", linewidth=0.5)
        axes.set_axisbelow(True)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        axes.set_title(f"{site.name}: {len(world.walls)} walls, {len(world.corners)} corners", loc="left")
        figure.legend(loc="outside lower center", ncols=5, frameon=False)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            figure.savefig(path, dpi=100)
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{path}: cannot be written: {error}") from None
