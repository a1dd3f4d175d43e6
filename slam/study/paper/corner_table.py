"""Tables of a study of corners: per method and true corner, and per method over all."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from slam.study.paper.corners import FALSE_DISTANCE, FOUND_DISTANCE, PHANTOM_DISTANCE, CornerSettings, Found, Seen
from slam.study.paper.methods import GATE_99, METHODS

PAPER_MEANS_MM: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "A": {"cwlf-paper": (23.02, 18.27), "arras-siegwart": (33.68, 27.98)},
    "B": {"cwlf-paper": (25.86, 13.92), "arras-siegwart": (25.32, 27.12)},
}
"""Means of the paper's Tables I and II: claimed sigma of x and of y [mm]."""

LABELS = {method.key: method.label for method in METHODS}


def corner_rows(seen: Sequence[Seen], found: Mapping[str, Found]) -> list[dict[str, Any]]:
    """One row per method and true corner that a scan shows; false corners are in no row."""
    rows: list[dict[str, Any]] = []
    for method, lot in found.items():
        nees, true = lot.nees, ~lot.false
        for index, world in enumerate(seen):
            for number, corner in enumerate(world.order.tolist(), start=1):
                of = true & (lot.worlds == index) & (lot.corners == corner)
                rows.append(
                    {
                        "method": method,
                        "world": world.name,
                        "corner": number,
                        "x_m": float(world.positions[corner, 0]),
                        "y_m": float(world.positions[corner, 1]),
                        "opening_angle_deg": float(np.degrees(world.opening_angles[corner])),
                        "scans_shown": int(world.shown[corner]),
                        "scans_clear": int(world.clear[corner]),
                        "detected": _detected(lot, of, world, corner),
                        **_errors(lot.errors[of] * 1e3, lot.covs[of] * 1e6, nees[of]),
                    }
                )
    return rows


def _detected(lot: Found, of: Any, world: Seen, corner: int) -> float:
    """Share of the scans that show a corner clearly, or at all where none does so clearly, in which it is found."""
    clear = int(world.clear[corner])
    if clear:
        return len(np.unique(lot.scans[of & lot.clear])) / clear
    return min(1.0, len(np.unique(lot.scans[of])) / int(world.shown[corner]))


def _errors(errors_mm: Array, covs_mm2: Array, nees: Array) -> dict[str, Any]:
    """Claimed and true errors of a lot of corners [mm]; NaN for none."""
    count = len(errors_mm)
    nothing = np.full(2, np.nan)
    sigma = np.sqrt(np.diagonal(covs_mm2, axis1=1, axis2=2)).mean(axis=0) if count else nothing
    rms = np.sqrt((errors_mm**2).mean(axis=0)) if count else nothing
    bias = errors_mm.mean(axis=0) if count else nothing
    return {
        "corners": count,
        "sigma_x_mm": float(sigma[0]),
        "sigma_y_mm": float(sigma[1]),
        "rms_x_mm": float(rms[0]),
        "rms_y_mm": float(rms[1]),
        "bias_x_mm": float(bias[0]),
        "bias_y_mm": float(bias[1]),
        "nees_half": float(nees.mean() / 2.0) if count else float("nan"),
        "outside_99": float((nees > GATE_99).mean()) if count else float("nan"),
    }


def _reported(lot: Found, scans: int) -> dict[str, Any]:
    """Figures of every corner that was reported, also of those that are none."""
    nees = lot.nees
    phantom = np.hypot(*lot.errors.T) > PHANTOM_DISTANCE

    def of(function: Callable[[NDArray[Any]], Any], values: NDArray[Any]) -> float:
        return float(function(values)) if len(values) else float("nan")

    return {
        "corners_per_scan": len(nees) / scans,
        "outside_99": of(np.mean, nees > GATE_99),
        "outside_99_near": of(np.mean, nees[~phantom] > GATE_99),
        "nees_half": of(np.mean, nees) / 2.0,
        "nees_half_median": of(np.median, nees) / 2.0,
        "nees_half_near": of(np.mean, nees[~phantom]) / 2.0,
        "phantoms": of(np.mean, phantom),
    }


def summarise(
    settings: CornerSettings,
    seen: Sequence[Seen],
    found: Mapping[str, Found],
    clear_found: Mapping[str, int],
    rows: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """Summary of each method.

    ``table`` has the means over the corners of the table, as the paper has them; ``pooled`` counts every corner that
    was reported and is not a false one; the paper's own means are added where it has any. ``reported`` counts every
    corner that was reported, with its error from the nearest true one: share outside its 99 % gate, mean and median of
    NEES/2, share of phantoms (:data:`PHANTOM_DISTANCE`), share outside and mean of NEES/2 of those that are none, and
    share of the clear corners that were found (:data:`FOUND_DISTANCE`).
    """
    clear = sum(int(world.clear.sum()) for world in seen)
    methods: dict[str, Any] = {}
    for method, lot in found.items():
        true, mine = ~lot.false, [row for row in rows if row["method"] == method]
        pooled = _errors(lot.errors[true] * 1e3, lot.covs[true] * 1e6, lot.nees[true])
        shown = true & lot.clear
        hits = len(np.unique(np.column_stack([lot.scans[shown], lot.corners[shown]]), axis=0))
        methods[method] = {
            "table": {
                name: float(np.nanmean([row[name] for row in mine])) if any(row["corners"] for row in mine) else np.nan
                for name in ("sigma_x_mm", "sigma_y_mm", "rms_x_mm", "rms_y_mm", "nees_half")
            },
            "reported": _reported(lot, settings.scans)
            | {"clear_found": clear_found[method] / clear if clear else float("nan")},
            "pooled": pooled | {"rms_mm": float(np.hypot(pooled["rms_x_mm"], pooled["rms_y_mm"]))},
            "detected_clear": hits / clear if clear else float("nan"),
            "scans_with_false_corner": len(np.unique(lot.scans[lot.false])) / settings.scans,
            "paper_sigma_mm": list(PAPER_MEANS_MM.get(settings.environment, {}).get(method, ())) or None,
        }
    return {
        "environment": settings.environment,
        "scans": settings.scans,
        "sensor": settings.sensor,
        "effects": settings.effects,
        "sigma_range_mm": settings.sigma_range_mm,
        "corners_in_table": sum(len(world.order) for world in seen),
        "corners_clear_per_scan": clear / settings.scans,
        "methods": methods,
    }


def summary_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lay the summary out for a terminal."""
    lines = [
        f"environment {summary['environment']}, {summary['sensor']}, effects {summary['effects']}, "
        f"sigma_range {summary['sigma_range_mm']:g} mm, {summary['scans']} scans, "
        f"{summary['corners_in_table']} corners, {summary['corners_clear_per_scan']:.1f} of them clear in a scan",
        f"{'':<30}{'claimed':>13}{'true RMS':>13}{'paper claims':>15}{'NEES/2':>8}{'outside':>9}{'found':>8}"
        f"{'false':>8}{'RMS':>8}",
        f"{'method':<30}{'x / y [mm]':>13}{'x / y [mm]':>13}{'x / y [mm]':>15}{'':>8}{'99 %':>9}{'clear':>8}"
        f"{'scans':>8}{'[mm]':>8}",
    ]
    for key, of in summary["methods"].items():
        table, pooled, paper = of["table"], of["pooled"], of["paper_sigma_mm"]
        lines.append(
            f"{LABELS[key]:<30}"
            f"{table['sigma_x_mm']:>6.1f} /{table['sigma_y_mm']:>5.1f}"
            f"{table['rms_x_mm']:>6.1f} /{table['rms_y_mm']:>5.1f}"
            f"{f'{paper[0]:.2f} / {paper[1]:.2f}' if paper else '-':>15}{pooled['nees_half']:>8.3f}"
            f"{pooled['outside_99']:>9.2%}{of['detected_clear']:>8.2%}{of['scans_with_false_corner']:>8.2%}"
            f"{pooled['rms_mm']:>8.2f}"
        )
    lines += [
        "claimed and true RMS: means over the corners of the table; NEES/2, outside and RMS: all corners reported that "
        f"are nearer than {FALSE_DISTANCE:g} m to a true one",
        f"{'every corner reported':<30}{'outside':>9}{'NEES/2':>10}{'median':>8}{'phantoms':>10}"
        f"{'no phantom: outside, NEES/2':>29}{'clear found':>13}{'a scan':>8}",
    ]
    for key, of in summary["methods"].items():
        reported = of["reported"]
        lines.append(
            f"{LABELS[key]:<30}{reported['outside_99']:>9.2%}{reported['nees_half']:>10.3f}"
            f"{reported['nees_half_median']:>8.3f}{reported['phantoms']:>10.2%}{reported['outside_99_near']:>18.2%}"
            f"{reported['nees_half_near']:>11.3f}{reported['clear_found']:>13.2%}{reported['corners_per_scan']:>8.2f}"
        )
    lines.append(
        f"phantoms: farther than {PHANTOM_DISTANCE:g} m from every true corner; clear corners are found where one is "
        f"reported within {FOUND_DISTANCE:g} m or holds them in its 99 % gate"
    )
    return lines
