"""Many simulated runs of the whole pipeline: how large its errors are, and whether they are as large as it claims."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from drivers.frame import SourceInfo
from features.se2 import Array
from features.sensor import sensor_preset
from sim import EFFECTS, ODOMETRIES, Lidar, SimulatedRun, Site, effects_of, find_site, site_run
from slam.config import SlamConfig
from slam.config_file import load_config
from slam.errors import StudyError
from slam.evaluation.metrics import mean_interval
from slam.filter.ekf import POSE_DIM
from slam.study.monte_carlo.bars import bars, bars_table
from slam.study.monte_carlo.batch_means import batch_means, batch_means_table
from slam.study.monte_carlo.simulated import INSTANTS, simulate
from slam.study.tasks.run import Failure

SENSOR = "rplidar-s1"
"""Preset of the sensor that the robot of a study carries by default."""

EACH = "-*"
"""A world whose name ends so is another one in each run, such as cluttered-room-*."""

ROOMS_OF_STUDY = 10_000
"""Rooms that are drawn for one study before those of the next seed begin."""

FIGURES: Mapping[str, tuple[str, float, str, bool]] = {
    "ate_online_m": ("ATE, online", 1e3, "mm", True),
    "ate_final_m": ("ATE, final", 1e3, "mm", True),
    "landmark_rmse_m": ("landmark RMSE", 1e3, "mm", True),
    "association_precision": ("association precision", 100.0, "%", False),
    "association_recall": ("association recall", 100.0, "%", False),
    "landmarks": ("landmarks", 1.0, "", True),
    "duplicates_share": ("duplicates, of the landmarks", 100.0, "%", True),
    "false_landmarks": ("landmarks that are no corner", 1.0, "", True),
    "landmarks_born": ("landmarks ever born", 1.0, "", True),
    "landmarks_merged": ("of these, merged", 1.0, "", True),
    "landmarks_ended": ("of these, ended", 1.0, "", True),
    "closures": ("closures accepted", 1.0, "", False),
    "closures_revoked": ("of these, revoked", 1.0, "", True),
    "closures_false": ("false closures left", 1.0, "", True),
}
"""What is summarised over the runs: label, factor and unit of its display, and whether less is better."""

TRACES: Mapping[str, str] = {"nees_ekf": "filter", "nees_graph": "graph"}
"""Poses whose NEES is followed over the runs."""

RUN_NEES: Mapping[str, tuple[str, int]] = {
    "landmark_nees": ("landmarks", 2),
    "closure_nees": ("closures", POSE_DIM),
}
"""NEES of which each run has one mean: label and degrees of freedom."""


def site_digest(site: Site) -> str:
    """Digest of walls, glass and path."""
    digest = hashlib.sha256(site.walls.tobytes() + site.glass.tobytes())
    digest.update(b"" if site.waypoints is None else site.waypoints.tobytes())
    return digest.hexdigest()[:16]


class MonteCarloSettings(BaseModel):
    """What a study of simulated runs depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    world: str = Field(
        description="what is driven through: built in, random-room-SEED, cluttered-room-SEED, or a file; with * in "
        "place of SEED another room in each run"
    )
    world_digest: str = Field(
        default_factory=lambda given: site_digest(find_site(_name(given["world"], 0))),
        description="of its walls and path, as a file may change from one run to the next",
    )
    sensor: str = Field(default=SENSOR, description="preset of the scanner")
    sigma_range_mm: float = Field(
        default_factory=lambda given: round(sensor_preset(given["sensor"]).sigma_range * 1e3, 6),
        gt=0.0,
        description="true standard deviation of a range, whatever the configuration takes it for [mm]",
    )
    effects: str = Field(default="ideal", description=f"what the scanner does beside: on, off, {', '.join(EFFECTS)}")
    odometry: str = Field(default="poor", description=f"errors of the wheels: {', '.join(ODOMETRIES)}")
    people: int = Field(default=0, ge=0, description="who go to and fro beside the path")
    seeds: int = Field(ge=1, description="runs, each with a seed of its own")
    scans: int = Field(default=0, ge=0, description="a run stops after so many scans; 0: at its end")
    seed: int = Field(default=1, ge=0, description="of the study; those of the runs are made of it")
    config: SlamConfig = Field(description="of every run")


def study_config(path: Path | None = None, sensor: str = SENSOR) -> SlamConfig:
    """Put a configuration together: that of the sensor that the robot of a study carries, over it a TOML file.

    Raises
    ------
    ConfigError
        See :func:`slam.config_file.load_config`.
    """
    return load_config(path, source=SourceInfo("simulated", sensor))


def simulated_run(settings: MonteCarloSettings, seed: int, run: int = 0) -> SimulatedRun:
    """Make the run of a seed; where the world is another one in each run, through the room of this run.

    Raises
    ------
    WorldError
        See :func:`sim.find_site` and :func:`sim.site_run`.
    StudyError
        The world is not the one that the study was begun with.
    """
    site = find_site(_name(settings.world, ROOMS_OF_STUDY * settings.seed + run))
    if not settings.world.endswith(EACH) and site_digest(site) != settings.world_digest:
        raise StudyError(f"world {settings.world!r} is not the one that the study was begun with")
    lidar = Lidar.of_preset(settings.sensor, effects=effects_of(settings.effects, settings.sensor))
    lidar = replace(lidar, sigma_range=settings.sigma_range_mm * 1e-3)
    return site_run(site, lidar, settings.sensor, seed, odometry=ODOMETRIES[settings.odometry], people=settings.people)


def _name(world: str, number: int) -> str:
    """Name of a world, of those that are another one in each run the one of a number."""
    return f"{world.removesuffix('*')}{number}" if world.endswith(EACH) else world


def run_task(settings: MonteCarloSettings, task: int, seed: int) -> dict[str, Any]:
    """Do one run; see :func:`slam.study.monte_carlo.simulated.simulate`."""
    source = simulated_run(settings, seed, task)
    result = simulate(source, settings.config, settings.scans)
    return result | {"row": {"run": task, "seed": seed, "world": source.name} | result["row"]}


def run_rows(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per run: its figures, NIS per degree of freedom, and the means over its instants of the pose's NEES."""
    rows: list[dict[str, Any]] = []
    for result in results:
        row: dict[str, Any] = dict(result["row"])
        row["nis"] = row["nis"] / row["nis_dof"] if row["nis_dof"] else None
        means = {name: None if result[name] is None else float(np.array(result[name]).mean()) for name in TRACES}
        rows.append(row | means)
    return rows


def nees_rows(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per instant and estimate: mean of the pose's NEES over the runs and the interval of such a mean."""
    rows: list[dict[str, Any]] = []
    for name, label in TRACES.items():
        of_runs = _trace(results, name)
        if not len(of_runs):
            continue
        low, high = mean_interval(POSE_DIM, len(of_runs))
        for instant, mean in enumerate(of_runs.mean(axis=0), start=1):
            rows.append(
                {
                    "pose_of": label,
                    "share_of_run": instant / INSTANTS,
                    "runs": len(of_runs),
                    "nees": float(mean),
                    "low_95": low,
                    "high_95": high,
                }
            )
    return rows


def _trace(results: Sequence[Mapping[str, Any]], name: str) -> Array:
    """NEES of the pose in the runs that have it, shape (runs, instants)."""
    return np.array([result[name] for result in results if result[name] is not None])


def monte_carlo_summary(
    settings: MonteCarloSettings, results: Sequence[Mapping[str, Any]], failures: Sequence[Failure]
) -> dict[str, Any]:
    """Summary of all runs.

    NEES: mean over the runs and over what each has of it (instants of the pose, landmarks, closures), beside the
    interval that holds the mean over as many independent values as there are runs with 95 %; for the pose also the
    share of the instants whose mean it holds. What a run has of it depends on each other, so for the mean over that too
    the interval is wide rather than narrow. NIS: mean per degree of freedom; innovations are independent, so the
    interval is that of all of them. Anything else: mean, the value that 95 % of the runs do not exceed (or do not fall
    short of, where more is better), and the worst. ``batch_means``: see
    :func:`slam.study.monte_carlo.batch_means.batch_means`.
    """
    rows = [result["row"] for result in results]
    nis, dof = (sum(row[name] for row in rows) for name in ("nis", "nis_dof"))
    return {
        "world": settings.world,
        "runs": len(rows),
        "failures": [{"run": of.task, "seed": of.seed, "error": of.error} for of in failures],
        "graph_not_converged": sum(not row["graph_converged"] for row in rows),
        "sensor": settings.sensor,
        "effects": settings.effects,
        "odometry": settings.odometry,
        "batch_means": batch_means(results),
        "nees": _pose_nees(results) | _run_nees(rows),
        "nis": {"dof": dof, "mean": nis / dof, "expected": 1, "interval_95": [x / dof for x in mean_interval(dof, 1)]}
        if dof
        else None,
        "figures": {name: _spread([row[name] for row in rows], less) for name, (_, _, _, less) in FIGURES.items()},
    }


def _pose_nees(results: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    return {
        f"pose, {label}": _nees(of_runs, POSE_DIM)
        | {"instants_inside": float(np.mean([_inside(mean, len(of_runs)) for mean in of_runs.mean(axis=0)]))}
        for name, label in TRACES.items()
        if len(of_runs := _trace(results, name))
    }


def _run_nees(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    known = {name: [row[name] for row in rows if row[name] is not None] for name in RUN_NEES}
    return {label: _nees(np.array(known[name]), dof) for name, (label, dof) in RUN_NEES.items() if known[name]}


def _nees(of_runs: Array, dof: int) -> dict[str, Any]:
    """Mean over runs, the first axis, beside the interval of the mean over as many independent values."""
    interval = list(mean_interval(dof, len(of_runs)))
    return {"runs": len(of_runs), "mean": float(of_runs.mean()), "expected": dof, "interval_95": interval}


def _inside(mean: float, runs: int) -> bool:
    low, high = mean_interval(POSE_DIM, runs)
    return low <= mean <= high


def _spread(values: Sequence[float | None], less_is_better: bool) -> dict[str, float] | None:
    known = [value for value in values if value is not None]
    if not known:
        return None
    return {
        "runs": len(known),
        "mean": float(np.mean(known)),
        "p95": float(np.percentile(known, 95.0 if less_is_better else 5.0)),
        "worst": float(max(known) if less_is_better else min(known)),
    }


def monte_carlo_table(summary: Mapping[str, Any]) -> list[list[str]]:
    """Cells of the summary, a heading first, then one row per figure."""
    cells = [["", "mean", "95 % of runs", "worst run"]]
    for name, (label, factor, unit, _) in FIGURES.items():
        of = summary["figures"][name]
        values = ["-"] * 3 if of is None else [f"{factor * of[key]:.4g}" for key in ("mean", "p95", "worst")]
        cells.append([f"{label} [{unit}]" if unit else label, *values])
    return cells


def consistency_table(summary: Mapping[str, Any]) -> list[list[str]]:
    """Cells of the table on consistency of the covariances, heading first."""
    cells = [["", "mean", "right", "95 % interval", "instants inside"]]
    named = {f"NEES of {label}": of for label, of in summary["nees"].items()}
    if summary["nis"] is not None:
        named["NIS per degree of freedom"] = summary["nis"]
    for label, of in named.items():
        low, high = of["interval_95"]
        inside = f"{of['instants_inside']:.0%}" if "instants_inside" in of else ""
        cells.append([label, f"{of['mean']:.3f}", str(of["expected"]), f"{low:.3f} .. {high:.3f}", inside])
    return cells


def summary_tables(summary: Mapping[str, Any]) -> tuple[list[list[str]], ...]:
    """Cells of all tables of the summary, each with its heading first."""
    means = batch_means_table(summary["batch_means"])
    return monte_carlo_table(summary), consistency_table(summary), means, bars_table(bars(summary))


def monte_carlo_lines(summary: Mapping[str, Any]) -> list[str]:
    """Lay the summary out for a terminal."""
    lines = [
        f"{summary['runs']} runs through {summary['world']}, {len(summary['failures'])} failed; "
        f"{summary['sensor']}, effects {summary['effects']}, odometry {summary['odometry']}"
    ]
    for cells in summary_tables(summary):
        lines += [f"{row[0]:<30}" + "".join(f"{cell:>18}" for cell in row[1:]) for row in cells]
    return lines
