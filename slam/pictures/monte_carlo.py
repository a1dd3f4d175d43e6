# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of keyword arguments open.
"""Picture of a study of simulated runs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from slam.evaluation.metrics import mean_interval
from slam.pictures.style import BAND, INK, STYLE, new_figure, save

TEAL, RED, BLUE = "#1b7f79", "#d1495b", "#3a6ea5"
Rows = Sequence[Mapping[str, Any]]


def draw_monte_carlo(path: Path, summary: Mapping[str, Any], rows: Rows, traces: Rows) -> None:
    """Draw the errors of the runs, NEES of the pose along them, NIS and associations of each.

    Parameters
    ----------
    path : PNG file to write.
    summary, rows, traces : of :mod:`slam.study.monte_carlo.runs`.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(12.0, 7.6)
        errors, along, nis, associations = figure.subplots(2, 2).ravel()
        _draw_shares(errors, rows)
        _draw_nees(along, traces)
        _draw_nis(nis, rows)
        _draw_associations(associations, rows)
        figure.suptitle(f"{summary['runs']} simulated runs through {summary['world']}", fontsize=12)
        save(figure, path)


def _column(rows: Rows, name: str) -> np.ndarray:
    """Values of the runs, NaN where one has none."""
    return np.array([row[name] for row in rows], dtype=np.float64)


def _draw_shares(axes: Axes, rows: Rows) -> None:
    """Share of the runs that err no more than so much."""
    shown = (
        ("ate_online_m", "ATE, online", RED),
        ("ate_final_m", "ATE, final", TEAL),
        ("landmark_rmse_m", "landmark RMSE", BLUE),
    )
    for name, label, color in shown:
        values = np.sort(1e3 * _column(rows, name))
        axes.step(values, np.arange(1, len(values) + 1) / len(values), where="post", color=color, label=label)
    axes.set(xlabel="error [mm]", ylabel="share of the runs", ylim=(0.0, 1.02))
    axes.legend(loc="lower right")


def _draw_nees(axes: Axes, traces: Rows) -> None:
    for label, color in (("filter", RED), ("graph", TEAL)):
        mine = [row for row in traces if row["pose_of"] == label]
        if mine:
            at = 100.0 * _column(mine, "share_of_run")
            axes.fill_between(at, _column(mine, "low_95"), _column(mine, "high_95"), color=BAND, linewidth=0.0)
            axes.plot(at, _column(mine, "nees"), "o-", color=color, markersize=4, label=label)
    axes.axhline(3.0, color=INK, linewidth=0.8)
    axes.set(xlabel="share of the run [%]", ylabel="NEES of the pose, mean of the runs", ylim=(0.0, None))
    axes.set_title("3 is right; 95 % of the means of right covariances are in the band", loc="left", fontsize=9.5)
    axes.legend()


def _draw_nis(axes: Axes, rows: Rows) -> None:
    runs, values = _column(rows, "run"), _column(rows, "nis")
    known = [row["nis_dof"] for row in rows if row["nis_dof"]]
    if known:
        dof = float(np.median(known))
        axes.axhspan(*(bound / dof for bound in mean_interval(dof, 1)), color=BAND)
    axes.plot(runs, values, ".", color=BLUE)
    axes.axhline(1.0, color=INK, linewidth=0.8)
    axes.set(xlabel="run", ylabel="NIS per degree of freedom")
    axes.set_title("1 is right; 95 % of the runs of a right filter are in the band", loc="left", fontsize=9.5)


def _draw_associations(axes: Axes, rows: Rows) -> None:
    runs = _column(rows, "run")
    for name, label, color, marker in (
        ("association_precision", "precision", TEAL, "."),
        ("association_recall", "recall", BLUE, "x"),
    ):
        axes.plot(runs, 100.0 * _column(rows, name), marker, color=color, label=label)
    axes.plot(runs, 100.0 * _column(rows, "duplicates_share"), "+", color=RED, label="duplicates, of the landmarks")
    axes.set(xlabel="run", ylabel="[%]", ylim=(-4.0, 104.0))
    axes.legend(loc="center right")
