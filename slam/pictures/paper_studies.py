# pyright: reportUnknownMemberType=false
# matplotlib leaves the types of keyword arguments open.
"""Pictures of the studies of single corners: accuracy, consistency, time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from slam.pictures.style import BAND, INK, STYLE, new_figure, save

COLORS: Mapping[str, str] = {
    "cwlf-paper": "#d1495b",
    "cwlf-propagated": "#e9a23b",
    "effective-variance": "#1b7f79",
    "arras-siegwart": "#3a6ea5",
    "total-least-squares": "#8a94a3",
    "cwlf": "#d1495b",
    "arras-siegwart-literal": "#8fb4d9",
}
MARKERS: Mapping[str, str] = {
    "cwlf-paper": "o",
    "cwlf-propagated": "s",
    "effective-variance": "D",
    "arras-siegwart": "^",
    "total-least-squares": "x",
}
SHORT: Mapping[str, str] = {
    "cwlf": "CWLF",
    "arras-siegwart": "A-S",
    "arras-siegwart-literal": "A-S as\nprinted",
}
Rows = Sequence[Mapping[str, Any]]


def draw_corners(path: Path, summary: Mapping[str, Any], rows: Rows, labels: Mapping[str, str]) -> None:
    """Draw, by corner, claimed sigma and true RMS error of x and y for three methods, and NEES/2 of all.

    Parameters
    ----------
    path : PNG file to write.
    summary, rows : of the study of corners; more than one world is drawn by worlds.
    labels : of the methods.
    """
    shown = [key for key in ("cwlf-paper", "arras-siegwart", "effective-variance") if key in summary["methods"]]
    worlds = len({row["world"] for row in rows})
    with mpl.rc_context(STYLE):
        figure = new_figure(11.0, 9.0)
        axes = figure.subplots(3, 1, height_ratios=[1.0, 1.0, 0.9], sharex=True)
        for axis, name in zip(axes[:2], "xy", strict=True):
            for offset, method in zip((-0.27, 0.0, 0.27), shown, strict=False):
                claimed, true = (_column(rows, method, f"{kind}_{name}_mm") for kind in ("sigma", "rms"))
                at = np.arange(1, len(claimed) + 1) + offset
                axis.bar(at, claimed, 0.25, color=COLORS[method], label=f"{labels[method]}: claimed sigma")
                axis.plot(at, true, "_", color=INK, markersize=8, markeredgewidth=2.0)
            axis.plot([], [], "_", color=INK, markersize=8, markeredgewidth=2.0, label="true RMS error")
            axis.set_ylabel(f"{name} [mm]")
            axis.grid(axis="x", visible=False)
        _legend_above(axes[0], 4)
        axes[2].axhspan(0.9, 1.1, color=BAND)
        for method in summary["methods"]:
            half = _column(rows, method, "nees_half")
            at = np.arange(1, len(half) + 1)
            axes[2].plot(at, half, MARKERS[method], color=COLORS[method], markersize=5, label=labels[method])
        axes[2].set_yscale("log")
        axes[2].set_ylabel("NEES/2 (1 is right)")
        _legend_above(axes[2], 5)
        axes[2].set_xlabel("corner, clockwise" if worlds == 1 else "room (means over its corners)")
        axes[2].set_xticks(np.arange(1, len(_column(rows, shown[0], "nees_half")) + 1))
        figure.suptitle(
            f"Environment {summary['environment']}: what is claimed and what is true "
            f"({summary['scans']} scans, sigma_range {summary['sigma_range_mm']:g} mm)",
            fontsize=12,
        )
        save(figure, path)


def _legend_above(axes: Axes, columns: int) -> None:
    axes.legend(ncols=columns, fontsize=8.5, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


def _column(rows: Rows, method: str, name: str) -> np.ndarray:
    """Values of a method by corner; by world, the means of each, where there is more than one."""
    mine = [row for row in rows if row["method"] == method]
    worlds = list(dict.fromkeys(row["world"] for row in mine))
    if len(worlds) == 1:
        return np.array([row[name] for row in mine], dtype=np.float64)
    known = {world: [row for row in mine if row["world"] == world and row["corners"]] for world in worlds}
    return np.array(
        [
            np.average([row[name] for row in of], weights=[row["corners"] for row in of]) if of else np.nan
            for of in known.values()
        ]
    )


def draw_consistency(
    path: Path, subtitle: str, rows: Rows, sweeps: Mapping[str, str], labels: Mapping[str, str]
) -> None:
    """Draw on one page NEES/2 and bias over each sweep, and the map of NEES/2 of the paper's covariance.

    Parameters
    ----------
    path : PNG file to write.
    subtitle : what each panel keeps.
    rows : of the study of consistency; those with a second value make the map.
    sweeps, labels : labels of the sweeps and of the methods.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(13.0, 13.6)
        grid = figure.add_gridspec(5, 6, height_ratios=[1.25, 1.0, 1.0, 0.75, 0.75])
        for place, method in zip((slice(0, 3), slice(3, 6)), ("cwlf-paper", "effective-variance"), strict=True):
            _draw_map(
                figure.add_subplot(grid[0, place]),
                f"NEES/2, {labels[method]}",
                [row for row in rows if row["second"] is not None and row["method"] == method],
            )
        for number, (sweep, label) in enumerate(sweeps.items()):
            place = slice(2 * (number % 3), 2 * (number % 3) + 2)
            nees = figure.add_subplot(grid[1 + number // 3, place])
            bias = figure.add_subplot(grid[3 + number // 3, place])
            nees.axhspan(0.9, 1.1, color=BAND)
            nees.set_yscale("log")
            values = list(dict.fromkeys(row["value"] for row in rows if row["sweep"] == sweep))
            for method in labels:
                mine = [row for row in rows if row["sweep"] == sweep and row["method"] == method]
                style: dict[str, Any] = {
                    "color": COLORS[method],
                    "marker": MARKERS[method],
                    "markersize": 4,
                    "linewidth": 1.3,
                }
                nees.plot(values, [row["nees_half"] for row in mine], label=labels[method], **style)
                bias.plot(values, [row["bias_mm"] for row in mine], **style)
            for axis in (nees, bias):
                axis.set_xlabel(label)
                if sweep in {"points", "sigma_bearing_deg"}:
                    axis.set_xscale("log")
                    axis.set_xticks(values, [f"{value:g}" for value in values])
                    axis.minorticks_off()
            nees.set_ylabel("NEES/2")
            bias.set_ylabel("bias [mm]")
            bias.set_ylim(bottom=0.0)
            if number == 0:
                handles, names = nees.get_legend_handles_labels()
                figure.legend(handles, names, loc="outside lower center", ncols=5)
        figure.suptitle(
            f"Where a covariance holds: NEES/2 is 1 where the claimed covariance is right\n{subtitle}",
            fontsize=10.5,
        )
        save(figure, path)


def _draw_map(axes: Axes, title: str, rows: Rows) -> None:
    """Draw NEES/2 over noise and incidence as a table whose colour says how far it is from 1."""
    sigmas_mm, incidences_deg = (list(dict.fromkeys(row[name] for row in rows)) for name in ("value", "second"))
    table = np.array([row["nees_half"] for row in rows]).reshape(len(sigmas_mm), len(incidences_deg))
    axes.imshow(np.abs(np.log10(table)), cmap="RdYlGn_r", vmin=0.0, vmax=1.2, aspect="auto", origin="lower", alpha=0.75)
    for (i, j), value in np.ndenumerate(table):
        axes.text(j, i, f"{value:.3g}" if value >= 10.0 else f"{value:.2f}", ha="center", va="center")
    axes.set_xticks(range(len(incidences_deg)), [f"{value:g}" for value in incidences_deg])
    axes.set_yticks(range(len(sigmas_mm)), [f"{value:g}" for value in sigmas_mm])
    axes.set_xlabel("angle of the first wall to the line of sight [deg]")
    axes.set_ylabel("sigma_range [mm]")
    axes.set_title(title, loc="left", fontsize=10.5)
    axes.grid(visible=False)


def draw_figure_3(path: Path, rows: Rows, forms: Mapping[str, str]) -> None:
    """Draw the time of a corner against the number of measurements, and the ratios: the paper's Fig. 3.

    Parameters
    ----------
    path : PNG file to write.
    rows : of the study of timing.
    forms : label of each form that was timed.
    """
    with mpl.rc_context(STYLE):
        figure = new_figure(9.5, 5.4)
        axes = figure.add_subplot()
        counts = [row["measurements"] for row in rows]
        for form, label in forms.items():
            axes.plot(
                counts, [row[f"{form.replace('-', '_')}_us"] for row in rows], "o-", color=COLORS[form], label=label
            )
        axes.set(xscale="log", yscale="log", xlabel="measurements of the corner", ylabel="time [us]")
        ratio = axes.twinx()
        ratio.plot(counts, [row["ratio_as_printed"] for row in rows], "--", color="#b03a2e", label="ratio, as printed")
        ratio.plot(counts, [row["ratio_single_sums"] for row in rows], ":", color="#b03a2e", label="ratio, single sums")
        ratio.set(yscale="log", ylabel="Arras-Siegwart / CWLF")
        ratio.grid(visible=False)
        lines = [*axes.get_legend_handles_labels()[0], *ratio.get_legend_handles_labels()[0]]
        axes.legend(handles=lines, loc="upper left")
        axes.set_xticks(counts, [str(count) if count not in {70, 90, 700} else "" for count in counts], minor=False)
        axes.minorticks_off()
        axes.set_title(
            "Time of a corner with its uncertainty (corner 20 of environment A; compiled, one core)", loc="left"
        )
        save(figure, path)


def draw_steps(path: Path, environment: str, steps: Rows, uncertainty: Rows, labels: Mapping[str, str]) -> None:
    """Draw uncertainty and time by step of one corner for two numbers of measurements: the paper's Fig. 4 or 5.

    Parameters
    ----------
    path : PNG file to write.
    environment : of which corner, A or B.
    steps, uncertainty : of the study of timing.
    labels : of the methods.
    """
    shades = ("#22577a", "#38a3a5", "#e9a23b", "#d1495b")
    with mpl.rc_context(STYLE):
        figure = new_figure(11.5, 5.2)
        left, right = figure.subplots(1, 2)
        mine = [row for row in uncertainty if row["environment"] == environment]
        counts = list(dict.fromkeys(row["measurements"] for row in steps))
        forms = list(dict.fromkeys(row["form"] for row in steps))
        names = list(dict.fromkeys(row["step"] for row in steps))
        shown = ("cwlf-paper", "arras-siegwart", "effective-variance")
        places = [(name, count) for name in "xy" for count in counts]
        for offset, method in zip((-0.27, 0.0, 0.27), shown, strict=True):
            of = {row["measurements"]: row for row in mine if row["method"] == method}
            at = np.arange(len(places)) + offset
            left.bar(at, [of[n][f"sigma_{a}_mm"] for a, n in places], 0.25, color=COLORS[method], label=labels[method])
            left.plot(at, [of[n][f"rms_{a}_mm"] for a, n in places], "_", color=INK, markersize=12, markeredgewidth=2.2)
        left.plot([], [], "_", color=INK, markersize=12, markeredgewidth=2.2, label="true RMS error")
        left.set_xticks(range(len(places)), [f"sigma {name}\n{count} points" for name, count in places])
        left.set_ylabel("claimed sigma [mm]")
        left.set_title("Uncertainty", loc="left")
        left.grid(axis="x", visible=False)
        left.set_ylim(top=1.35 * left.get_ylim()[1])
        left.legend(fontsize=8.5, ncols=2, loc="upper left")

        width = 0.19
        ticks: list[str] = []
        for group, (form, count) in enumerate((form, count) for form in forms for count in counts):
            of = {
                row["step"]: row["time_us"]
                for row in steps
                if (row["environment"], row["measurements"], row["form"]) == (environment, count, form)
            }
            for number, step in enumerate(names):
                right.bar(
                    group + (number - 1.5) * width,
                    of[step],
                    width,
                    color=shades[number],
                    label=step if group == 0 else None,
                )
            ticks.append(SHORT[form] + f"\n{count}")
        right.set_yscale("log")
        right.set_ylim(bottom=0.003)
        right.set_xticks(range(len(ticks)), ticks)
        right.set_ylabel("time [us]")
        right.set_title("Time of each step", loc="left")
        right.grid(axis="x", visible=False)
        right.legend(fontsize=8.5, loc="upper left")
        angle = mine[0]["corner_angle_deg"]
        number = {"A": 20, "B": 4}[environment]
        figure.suptitle(f"Corner {number} of environment {environment}, {angle:g} deg", fontsize=12)
        save(figure, path)
