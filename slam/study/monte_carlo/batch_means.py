"""Whether landmarks and poses err as much as they claim, in the frame of the start; each run is one sample.

What a run has of landmarks and poses depends on each other, runs do not: so the interval of a mean is that of the mean
over the runs (batch means; Law, Simulation Modeling and Analysis, 5th ed., section 9.5.3).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import t as student

from features.se2 import Array
from sim import World
from slam.evaluation.metrics import nees
from slam.filter.ekf import POSE_DIM
from slam.map.landmark_map import LandmarkMap
from slam.study.paper.methods import GATE_99

NO_CORNER = 0.2
"""A landmark farther than this from every true corner is no corner [m]."""

MEANS: Mapping[str, tuple[str, float, str, float | None]] = {
    "landmark_nees_half": ("NEES/2 of landmarks", 1.0, "", 1.0),
    "landmarks_outside_99": ("landmarks outside 99 %", 100.0, "%", 0.01),
    "landmarks_no_corner": ("landmarks that are no corner", 100.0, "%", None),
    "landmark_rms_m": ("error of landmarks, RMS", 1e3, "mm", None),
    "landmark_claimed_m": ("claimed, RMS", 1e3, "mm", None),
    "nees_ekf": ("NEES/3 of the pose, filter", 1.0, "", 1.0),
    "nees_graph": ("NEES/3 of the pose, graph", 1.0, "", 1.0),
}
"""Figures of a run: label, factor and unit of its display, and its expected value where covariances are right."""


def landmark_figures(world: World, landmarks: LandmarkMap) -> dict[str, float | None]:
    """Compare the landmarks of a run with the nearest true corners, in the world frame, which is that of the start.

    Returns
    -------
    Mean of NEES/2, RMS of the error and of what is claimed, each over the landmarks that are corners; share of all
    landmarks that are outside their 99 % gate, and that are no corner (:data:`NO_CORNER`). None without landmarks.
    """
    known = np.flatnonzero(np.isfinite(landmarks.covs).all(axis=(1, 2)))
    names = [name for name in MEANS if name.startswith("landmark")]
    if not len(known) or not len(world.corners):
        return dict.fromkeys(names)
    covs = landmarks.covs[known]
    apart = landmarks.positions[known][:, None] - world.corners
    errors = apart[np.arange(len(known)), (apart**2).sum(axis=2).argmin(axis=1)]
    distances, scores = np.hypot(*errors.T), nees(errors, covs)
    is_corner = distances <= NO_CORNER

    def mean(values: Array) -> float | None:
        return float(values[is_corner].mean()) if is_corner.any() else None

    squared, claimed = mean(distances**2), mean(np.trace(covs, axis1=1, axis2=2))
    half = mean(scores / 2.0)
    return {
        "landmark_nees_half": half,
        "landmarks_outside_99": float((scores > GATE_99).mean()),
        "landmarks_no_corner": float(1.0 - is_corner.mean()),
        "landmark_rms_m": None if squared is None else squared**0.5,
        "landmark_claimed_m": None if claimed is None else claimed**0.5,
    }


def batch_means(results: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any] | None]:
    """Take the mean of each figure over the runs, with the interval that holds its expectation with 95 %.

    Parameters
    ----------
    results : of :func:`slam.study.monte_carlo.simulated.simulate`.

    Returns
    -------
    By name of the figure: ``runs`` that have it, ``mean``, ``expected`` and ``interval_95``, which is None for one run;
    None where no run has it.
    """
    means: dict[str, dict[str, Any] | None] = {}
    for name, (_, _, _, expected) in MEANS.items():
        of_runs = [_figure(result, name) for result in results]
        values = np.array([value for value in of_runs if value is not None])
        if not len(values):
            means[name] = None
            continue
        mean, interval = float(values.mean()), None
        if len(values) > 1:
            quantiles = np.asarray(student.ppf([0.025, 0.975], len(values) - 1))
            interval = (mean + quantiles * values.std(ddof=1) / len(values) ** 0.5).tolist()
        means[name] = {"runs": len(values), "mean": mean, "expected": expected, "interval_95": interval}
    return means


def _figure(result: Mapping[str, Any], name: str) -> float | None:
    if name.startswith("landmark"):
        return result["row"][name]
    return None if result[name] is None else float(np.array(result[name]).mean()) / POSE_DIM


def batch_means_table(means: Mapping[str, Mapping[str, Any] | None]) -> list[list[str]]:
    """Cells of the means, a heading first."""
    cells = [["frame of the start", "mean", "right", "95 % interval"]]
    for name, (label, factor, unit, expected) in MEANS.items():
        of, right = means[name], "" if expected is None else f"{factor * expected:g}"
        mean = "-" if of is None else f"{factor * of['mean']:.4g}"
        interval = (
            "-"
            if of is None or of["interval_95"] is None
            else " .. ".join(f"{factor * limit:.4g}" for limit in of["interval_95"])
        )
        cells.append([f"{label} [{unit}]" if unit else label, mean, right, interval])
    return cells
