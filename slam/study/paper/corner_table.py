"""Tables of a study of corners: per method and true corner, and per method over all."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from features.se2 import Array
from slam.study.paper.corners import CornerSettings, Found, Seen
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


def summarise(
    settings: CornerSettings, seen: Sequence[Seen], found: Mapping[str, Found], rows: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Summary of each method.

    ``table`` has the means over the corners of the table, as the paper has them; ``pooled`` counts every corner that
    was reported and is not a false one; the paper's own means are added where it has any.
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
            "pooled": pooled | {"rms_mm": float(np.hypot(pooled["rms_x_mm"], pooled["rms_y_mm"]))},
            "detected_clear": hits / clear if clear else float("nan"),
            "scans_with_false_corner": len(np.unique(lot.scans[lot.false])) / settings.scans,
            "paper_sigma_mm": list(PAPER_MEANS_MM.get(settings.environment, {}).get(method, ())) or None,
        }
    return {
        "environment": settings.environment,
        "scans": settings.scans,
        "sigma_range_mm": settings.sigma_range_mm,
        "corners_in_table": sum(len(world.order) for world in seen),
        "corners_clear_per_scan": clear / settings.scans,
        "methods": methods,
    }


def summary_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lay the summary out for a terminal."""
    lines = [
        f"environment {summary['environment']}, sigma_range {summary['sigma_range_mm']:g} mm, "
        f"{summary['scans']} scans, {summary['corners_in_table']} corners, "
        f"{summary['corners_clear_per_scan']:.1f} of them clear in a scan",
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
    lines.append(
        "claimed and true RMS: means over the corners of the table; NEES/2, outside and RMS: all corners reported"
    )
    return lines
