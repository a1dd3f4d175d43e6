# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of keyword arguments open.
"""Picture of one scan: points by segment, fitted lines, corners with their ellipses."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.collections import EllipseCollection
from numpy.typing import NDArray

from features import Features, LaserScan
from features.se2 import Array
from slam.errors import RunFolderError
from slam.pictures.run_map import ellipses
from slam.pictures.style import INK, STYLE, new_figure

CYCLE = ("#1b7f79", "#3a6ea5", "#e9a23b", "#8e5ea2", "#5b8c3a", "#c0673a", "#4f9fc7", "#b0457b")
SIGMAS = 3.0


def draw_scan(path: Path, title: str, scan: LaserScan, features: Features, range_max: float) -> None:
    """Draw points coloured by segment, fitted lines, and corners with 3-sigma ellipses, sensor frame.

    Parameters
    ----------
    path : PNG file to write.
    title : heading of the picture.
    scan, features : what to draw.
    range_max : a longer range is no return and not drawn [m].

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    lines, corners = features.lines, features.corners
    x, y = scan.ranges * np.cos(scan.angles), scan.ranges * np.sin(scan.angles)
    belongs = np.full(len(scan), -1)
    for number in range(len(lines)):
        belongs[beams_of_line(scan, lines.beams[number])] = number
    returns = scan.ranges[scan.ranges <= range_max]
    near = (scan.ranges > 0.0) & (scan.ranges <= min(range_max, _reach(returns, features)))
    with mpl.rc_context(STYLE):
        figure = new_figure(9.5, 8.0)
        axes = figure.add_subplot()
        rest = near & (belongs < 0)
        axes.plot(x[rest], y[rest], ".", color="#b3bac4", markersize=4, label="on no line")
        for number, line in enumerate(lines):
            of = near & (belongs == number)
            color = CYCLE[number % len(CYCLE)]
            axes.plot(x[of], y[of], ".", color=color, markersize=5)
            axes.plot(*np.array([line.start, line.end]).T, color=color, linewidth=1.4, alpha=0.8)
        axes.plot(0.0, 0.0, marker=(3, 0, -90), color=INK, markersize=11, linestyle="", label="sensor, looks along x")
        if len(corners):
            widths, heights, angles = ellipses(corners.covs, SIGMAS)
            axes.plot(*corners.positions.T, "x", color="#d1495b", markersize=6, label="corner")
            axes.plot([], [], "o", markerfacecolor="none", color="#d1495b", markersize=10, label="3 sigma")
            axes.add_collection(
                EllipseCollection(
                    widths, heights, angles, units="xy", offsets=corners.positions, offset_transform=axes.transData,
                    facecolors="none", edgecolors="#d1495b", linewidths=1.2, zorder=5,
                )
            )  # fmt: skip
            for number, position in enumerate(corners.positions):
                axes.annotate(str(number), position, xytext=(6, 6), textcoords="offset points", color="#d1495b")
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(xlabel="x [m]", ylabel="y [m]")
        axes.set_title(f"{title}: {len(scan)} beams, {len(lines)} lines, {len(corners)} corners", loc="left")
        figure.legend(loc="outside lower center", ncols=4)
        try:
            figure.savefig(path, dpi=130)
        except (OSError, ValueError) as error:
            raise RunFolderError(f"{path}: cannot be written: {getattr(error, 'strerror', None) or error}") from None


def _reach(returns: Array, features: Features) -> float:
    """Range up to which points are drawn: what all features and nine of ten returns need [m]."""
    ends = [np.hypot(*features.lines.ends.reshape(-1, 2).T), np.hypot(*features.corners.positions.T)]
    farthest = max((float(end.max()) for end in ends if end.size), default=0.0)
    return max(1.3 * farthest, float(np.percentile(returns, 90.0)) if returns.size else 0.0)


def beams_of_line(scan: LaserScan, beams: NDArray[np.int64]) -> NDArray[np.int64]:
    """Beams from the first to the last one of a line, counter-clockwise, shape (n,)."""
    order = np.argsort(scan.angles % (2.0 * np.pi), kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    first, last = int(place[beams[0]]), int(place[beams[1]])
    return np.roll(order, -first)[: (last - first) % len(order) + 1]
