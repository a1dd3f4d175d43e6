# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of keyword arguments open.
"""Pictures of a run."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.random import Generator

from features.se2 import Array
from slam.result.result import SlamResult

INK, WALL, PATH, ODOMETRY = "#22272e", "#3b4554", "#1f77b4", "#9db8cc"
CONCAVE, CONVEX, POINT = "#d1495b", "#d98a1f", "#6a4c93"
MOST_POINTS = 150_000
"""Scan points drawn at most; of more, a random sample is drawn."""


def draw_map(path: Path, title: str, result: SlamResult, rng: Generator) -> None:
    """Draw walls as seen, trajectory, odometry and landmarks with their 2-sigma ellipses.

    Parameters
    ----------
    path : PNG file to write.
    title : heading of the picture.
    result : what to draw, world frame.
    rng : chooses the scan points where there are too many to draw.
    """
    with mpl.rc_context({"font.size": 10, "axes.edgecolor": "#9aa4b2", "axes.labelcolor": INK, "text.color": INK}):
        poses = result.trajectory.poses[:, :2]
        low, high = _extent(result)
        width, height = high - low
        extent = max(width, height)
        figure = Figure(figsize=_size(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_facecolor("#fbfbfa")

        points = result.points
        if len(points) > MOST_POINTS:
            points = points[np.sort(rng.choice(len(points), MOST_POINTS, replace=False))]
        axes.plot(points[:, 0], points[:, 1], ",", color="#8a94a3", alpha=0.5, zorder=1)
        axes.add_collection(LineCollection(list(result.walls), colors=WALL, linewidths=1.1, alpha=0.35, zorder=2))
        if _has_wheels(result):
            odometry = result.wheel_odometry.poses
            axes.plot(odometry[:, 0], odometry[:, 1], "--", color=ODOMETRY, linewidth=0.8, zorder=3)
        axes.plot(poses[:, 0], poses[:, 1], color=PATH, linewidth=1.3, zorder=4)
        axes.plot(*poses[0], "o", color=PATH, markersize=8, zorder=5)
        axes.plot(*poses[-1], "s", color=PATH, markersize=7, zorder=5)

        landmarks = result.landmarks
        colors = np.where(landmarks.points, POINT, np.where(landmarks.convex, CONVEX, CONCAVE))
        widths, heights, angles = ellipses(landmarks.covs, sigmas=2.0)
        magnification = _magnification(widths, extent)
        # A large ellipse is an outline, so that it hides nothing.
        axes.add_collection(
            EllipseCollection(
                widths * magnification,
                heights * magnification,
                angles,
                units="xy",
                offsets=landmarks.positions,
                offset_transform=axes.transData,
                facecolors=to_rgba_array(colors, np.where(widths * magnification < 0.05 * extent, 0.35, 0.0)),
                edgecolors=to_rgba_array(colors, np.where(widths * magnification < 0.05 * extent, 0.6, 0.25)),
                linewidths=0.8,
                zorder=3,
            )
        )
        axes.scatter(landmarks.positions[:, 0], landmarks.positions[:, 1], s=16, c=colors, marker="x", zorder=7)

        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1], high[1])
        axes.set_aspect("equal")
        axes.grid(color="#e3e6ea", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.set_xlabel("x [m]")
        axes.set_ylabel("y [m]")
        metrics = result.metrics
        frames = "scans" if len(result.points) else "observed frames"
        axes.set_title(
            f"{title}\n{metrics.scans} {frames}, {metrics.duration_s:.0f} s, {metrics.landmarks} landmarks, "
            f"{metrics.key_frames} key frames",
            loc="left",
            fontsize=11,
            pad=10.0,
        )
        figure.legend(
            handles=_legend(result, magnification), loc="outside lower center", ncols=4, frameon=False, fontsize=9
        )
        figure.savefig(path, dpi=150, bbox_inches="tight", pad_inches=0.15)


def ellipses(covs: Array, sigmas: float) -> tuple[Array, Array, Array]:
    """Full axes [m] and angle of the major one [deg] of covariance ellipses, shape (n,) each, of covs (n, 2, 2)."""
    values, vectors = np.linalg.eigh(covs)
    lengths = 2.0 * sigmas * np.sqrt(np.maximum(values, 0.0))
    major = vectors[:, :, 1]
    return lengths[:, 1], lengths[:, 0], np.degrees(np.arctan2(major[:, 1], major[:, 0]))


def _magnification(axes_lengths: Array, extent: float) -> int:
    """Power of ten that makes the median ellipse just visible on a map of this extent [m]."""
    if len(axes_lengths) == 0:
        return 1
    shown = float(np.median(axes_lengths)) / extent
    return int(10 ** max(0, np.ceil(np.log10(0.005 / shown)))) if shown > 0.0 else 1


def _extent(result: SlamResult) -> tuple[Array, Array]:
    """Corners of the part worth showing: all that the robot drove and nearly all that it saw."""
    seen = [result.trajectory.poses[:, :2], result.landmarks.positions]
    if len(result.points):
        seen.append(np.percentile(result.points, [0.5, 99.5], axis=0))
    if len(result.walls):
        seen.append(np.percentile(result.walls.reshape(-1, 2), [0.5, 99.5], axis=0))
    all_seen = np.concatenate(seen)
    low, high = all_seen.min(axis=0), all_seen.max(axis=0)
    margin = 0.04 * max(*(high - low), 1.0)
    return low - margin, high + margin


def _size(width: float, height: float) -> tuple[float, float]:
    """Figure size [inch] that suits the shape of the map."""
    longest = 10.0
    scale = longest / max(width, height)
    return max(width * scale, 6.0) + 0.8, max(height * scale, 4.0) + 1.4


def _has_wheels(result: SlamResult) -> bool:
    """Whether there is wheel odometry to draw: a source without any says that it stands at the origin."""
    return bool(result.wheel_odometry.poses.any())


def _legend(result: SlamResult, magnification: int) -> list[Line2D]:
    """Entries for what there is; of landmarks all kinds of corners, or points."""
    drawn = "2 sigma" if magnification == 1 else f"2 sigma x {magnification}"

    def entry(label: str, **style: Any) -> Line2D:
        return Line2D([], [], label=label, **style)

    walls = [entry("walls as seen", color=WALL, alpha=0.6)]
    corners = [
        entry(f"corner, concave, {drawn}", color=CONCAVE, marker="x", linestyle=""),
        entry(f"corner, convex, {drawn}", color=CONVEX, marker="x", linestyle=""),
    ]
    points = [entry(f"point, {drawn}", color=POINT, marker="x", linestyle="")]
    only_points = bool(result.landmarks.points.all()) and not len(result.walls)
    return [
        *(walls if not only_points else []),
        entry("trajectory", color=PATH),
        *([entry("wheels alone", color=ODOMETRY, linestyle="--")] if _has_wheels(result) else []),
        entry("start", color=PATH, marker="o", linestyle=""),
        entry("end", color=PATH, marker="s", linestyle=""),
        *(points if only_points else corners),
    ]
