"""Corners of two walls whose points need no segmentation: where each covariance holds, and where it does not."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from features import SensorModel, fit_line, intersect
from features.se2 import Array
from slam.evaluation.metrics import nees
from slam.study.paper.methods import GATE_99, METHODS, Method


class ConsistencySettings(BaseModel):
    """What a study of consistency depends on; each sweep changes one value and keeps the others."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    trials: int = Field(default=500, ge=2, description="noisy corners of each setting; all methods see the same")
    sigma_range_mm: float = Field(default=20.0, gt=0.0, description="standard deviation of a range [mm]")
    sigma_bearing_deg: float = Field(
        default=round(0.391 / math.sqrt(12.0), 6), gt=0.0, description="standard deviation of a beam's direction [deg]"
    )
    spacing_deg: float = Field(default=0.391, gt=0.0, description="angle between beams [deg]")
    wall_m: float = Field(default=2.0, gt=0.0, description="length of each of the two walls [m]")
    distance_m: float = Field(default=4.0, gt=0.0, description="of the corner from the sensor [m]")
    corner_angle_deg: float = Field(default=90.0, gt=0.0, lt=180.0, description="opening angle [deg]")
    incidence_deg: float = Field(
        default=45.0, gt=0.0, lt=90.0, description="angle between the first wall and the line of sight [deg]"
    )
    seed: int = Field(default=1, ge=0, description="of the noise")


@dataclass(frozen=True, slots=True)
class Scene:
    """A corner of two walls before the sensor, in the units of its settings.

    Parameters
    ----------
    points : of each wall; None for as many as the spacing of the beams gives.
    bearing_deg : direction of the corner in the sensor frame.
    """

    sigma_range_mm: float
    sigma_bearing_deg: float
    spacing_deg: float
    wall_m: float
    distance_m: float
    corner_angle_deg: float
    incidence_deg: float
    points: int | None = None
    bearing_deg: float = 0.0


SWEEPS: Mapping[str, tuple[str, tuple[float, ...]]] = {
    "sigma_range_mm": ("standard deviation of a range [mm]", (5, 10, 15, 20, 30, 40, 50)),
    "sigma_bearing_deg": ("standard deviation of a beam's direction [deg]", (0.02, 0.05, 0.113, 0.2, 0.3, 0.5)),
    "incidence_deg": ("angle of the first wall to the line of sight [deg]", (10, 15, 20, 30, 45, 60, 75, 80)),
    "points": ("points of each wall", (5, 10, 20, 50, 100, 200)),
    "corner_angle_deg": ("opening angle of the corner [deg]", (30, 50, 70, 90, 110, 130, 150)),
    "distance_m": ("distance of the corner [m]", (1, 2, 3, 4, 6, 8, 10)),
}
"""What is swept: its label and its values. The opening angle keeps the corner symmetric to the line of sight."""

MAP_SIGMAS_MM = (5.0, 10.0, 20.0, 30.0, 50.0)
MAP_INCIDENCES_DEG = (10.0, 15.0, 20.0, 30.0, 45.0)
"""Grid of the map of NEES/2 over noise and incidence."""

MAP = "sigma_range_mm x incidence_deg"
"""Name of the sweep that is the map; its second value is the incidence."""


def scenes(settings: ConsistencySettings) -> Iterator[tuple[str, float, float | None, Scene]]:
    """Yield sweep, value, second value (of the map only) and scene of each setting."""
    base = Scene(**{name.name: getattr(settings, name.name) for name in dataclasses.fields(Scene)[:-2]})
    for sweep, (_, values) in SWEEPS.items():
        for value in values:
            scene = dataclasses.replace(base, **{sweep: value})
            if sweep == "corner_angle_deg":
                # The walls open to the sensor's side, both at the same angle to the line of sight.
                scene = dataclasses.replace(scene, incidence_deg=value / 2.0)
            yield sweep, float(value), None, scene
    for sigma in MAP_SIGMAS_MM:
        for incidence in MAP_INCIDENCES_DEG:
            yield MAP, sigma, incidence, dataclasses.replace(base, sigma_range_mm=sigma, incidence_deg=incidence)


def noisy_walls(scene: Scene, trials: int, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Ranges, shape (trials, n) [m], and angles, shape (n,) [rad], of the first and the second wall.

    The corner opens towards the sensor. The direction of each beam is disturbed before it meets the wall, the range
    after (section III of the paper).
    """
    walls: list[tuple[Array, Array]] = []
    incidence, bearing = math.radians(scene.incidence_deg), math.radians(scene.bearing_deg)
    directions = math.pi - incidence, math.pi + math.radians(scene.corner_angle_deg) - incidence
    for direction in directions:
        end_x = scene.distance_m + scene.wall_m * math.cos(direction)
        end_y = scene.wall_m * math.sin(direction)
        extent = math.atan2(end_y, end_x)
        count = scene.points or max(3, int(abs(extent) / math.radians(scene.spacing_deg)))
        angles = extent * (np.arange(count) + 0.5) / count
        beams = angles + math.radians(scene.sigma_bearing_deg) * rng.standard_normal((trials, count))
        ranges = scene.distance_m * math.sin(direction) / np.sin(direction - beams)
        walls.append((ranges + 1e-3 * scene.sigma_range_mm * rng.standard_normal(ranges.shape), bearing + angles))
    return walls


def measure(scene: Scene, trials: int, rng: np.random.Generator, method: Method) -> dict[str, Any]:
    """Claimed and true error of a scene's corner by one method [mm]."""
    model = SensorModel(1e-3 * scene.sigma_range_mm, math.radians(scene.sigma_bearing_deg), 0.0, 100.0)
    (first, angles_first), (second, angles_second) = noisy_walls(scene, trials, rng)
    errors, covs = np.empty((trials, 2)), np.empty((trials, 2, 2))
    for trial in range(trials):
        line_a = fit_line(first[trial], angles_first, model, method.fit, method.covariance)
        line_b = fit_line(second[trial], angles_second, model, method.fit, method.covariance)
        errors[trial], covs[trial] = intersect(line_a, line_b)
    bearing = math.radians(scene.bearing_deg)
    errors -= scene.distance_m * np.array([math.cos(bearing), math.sin(bearing)])
    squares = nees(errors, covs)
    variances = np.diagonal(covs, axis1=1, axis2=2)
    sigma = 1e3 * np.sqrt(variances).mean(axis=0)
    rms = 1e3 * np.sqrt((errors**2).mean(axis=0))
    bias = 1e3 * errors.mean(axis=0)
    return {
        "points_first": angles_first.size,
        "points_second": angles_second.size,
        "claimed_mm": float(1e3 * np.sqrt(variances.sum(axis=1)).mean()),
        "rms_mm": float(1e3 * np.sqrt((errors**2).sum(axis=1).mean())),
        "sigma_x_mm": float(sigma[0]),
        "sigma_y_mm": float(sigma[1]),
        "rms_x_mm": float(rms[0]),
        "rms_y_mm": float(rms[1]),
        "bias_x_mm": float(bias[0]),
        "bias_y_mm": float(bias[1]),
        "bias_mm": float(np.hypot(*bias)),
        "nees_half": float(squares.mean() / 2.0),
        "outside_99": float((squares > GATE_99).mean()),
    }


def scene_task(settings: ConsistencySettings, task: int, seed: int) -> list[dict[str, Any]]:
    """Measure one setting by each method; all see the same noise."""
    scene = list(scenes(settings))[task][-1]
    return [measure(scene, settings.trials, np.random.default_rng(seed), method) for method in METHODS]


def consistency_rows(
    settings: ConsistencySettings, results: Sequence[Sequence[Mapping[str, Any]]]
) -> list[dict[str, Any]]:
    """One row per setting and method of what the tasks of :func:`scene_task` yielded, in the order of their numbers."""
    return [
        {"sweep": sweep, "value": value, "second": second, "method": method.key, **of}
        for (sweep, value, second, _), result in zip(scenes(settings), results, strict=True)
        for method, of in zip(METHODS, result, strict=True)
    ]


def consistency_summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Least and largest NEES/2 of each method, the setting of the largest, and the share of settings in 0.9..1.1."""
    summary: dict[str, Any] = {}
    for method in METHODS:
        mine = [row for row in rows if row["method"] == method.key]
        worst = max(mine, key=lambda row: row["nees_half"])
        summary[method.key] = {
            "nees_half_least": min(row["nees_half"] for row in mine),
            "nees_half_largest": worst["nees_half"],
            "largest_at": {name: worst[name] for name in ("sweep", "value", "second") if worst[name] is not None},
            "settings": len(mine),
            "settings_consistent": sum(0.9 <= row["nees_half"] <= 1.1 for row in mine),
            "bias_largest_mm": max(row["bias_mm"] for row in mine),
        }
    return summary


def consistency_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lay the summary out for a terminal."""
    lines = [f"{'method':<30}{'NEES/2':>16}{'0.9..1.1 in':>14}{'bias up to':>13}  worst at"]
    for method in METHODS:
        of = summary[method.key]
        at = of["largest_at"]
        where = f"{at['sweep']} = {at['value']:g}" + (f" x {at['second']:g}" if "second" in at else "")
        lines.append(
            f"{method.label:<30}{of['nees_half_least']:>8.2f} ..{of['nees_half_largest']:>6.2f}"
            f"{of['settings_consistent']:>8} of {of['settings']}{of['bias_largest_mm']:>10.1f} mm  {where}"
        )
    return lines
