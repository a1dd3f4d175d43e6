"""A run against what is known to be true: relations, a trajectory, or a simulation."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drivers.data_sets.mrclam import MrclamLog, is_mrclam
from drivers.open_log import is_recording
from drivers.recording.recording import Recording
from features.se2 import Array, Pose, align, transform
from sim.worlds.world import World
from slam.evaluation.metrics import Ate, Rpe, ate, match_landmarks, rpe
from slam.evaluation.relations import RelationError, read_relations, relations
from slam.result.result import SlamResult
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import read_trajectory_file

if TYPE_CHECKING:
    from sim.simulated_run import SimulatedRun

Report = dict[str, dict[str, float]]
"""Figures by what they were measured against and by name with unit."""

CORNER_DISTANCE = 0.3
"""A landmark farther than this from a corner of the simulated world is not that corner [m]."""

SURVEY_DISTANCE = 1.0
"""The same for a surveyed landmark and one of unknown identity [m]."""

MOST_MATCHINGS = 20
"""Of surveyed landmarks, each in the alignment of the one before."""


def evaluate_relations(path: Path, trajectory: Trajectory) -> Report:
    """Error of the relative poses of a trajectory against a relations file."""
    error = relations(read_relations(path), trajectory)
    return {"relations": _figures(error)}


def evaluate_truth(path: Path, trajectory: Trajectory, landmarks: Array, identities: NDArray[np.int64]) -> Report:
    """ATE and RPE of a trajectory, rigidly aligned, against a true one.

    That is a trajectory file, a recording, or an MRCLAM data set. Where a recording holds walls, the landmarks, shape
    (n, 2) [m], are compared with their corners, in the alignment of the trajectory; where a data set has surveyed
    landmarks, with these, in an alignment of their own, by ``identities`` where they are known, -1 where not, shape
    (n,).
    """
    if is_mrclam(path):
        data_set = MrclamLog(path)
        report, alignment = _trajectory_report(Trajectory(*data_set.truth()), trajectory)
        surveyed, positions = data_set.true_landmarks()
        return report | {"landmarks": _survey_report(surveyed, positions, identities, landmarks, alignment)}
    recording = Recording(path) if is_recording(path) else None
    true = read_trajectory_file(path) if recording is None else Trajectory(*recording.truth())
    report, alignment = _trajectory_report(true, trajectory)
    if recording is not None and len(recording.walls):
        corners = World(recording.name, recording.walls).corners
        errors = _landmark_errors(corners, transform(alignment, landmarks))
        report["landmarks"] = {"corners": len(corners), "corners_mapped": len(errors), "mapped": len(landmarks)}
        if len(errors):
            report["landmarks"] |= {"rmse_m": _root_mean_square(errors), "median_m": float(np.median(errors))}
    return report


def _trajectory_report(true: Trajectory, trajectory: Trajectory) -> tuple[Report, Pose]:
    """Errors of a trajectory, and the pose of its frame in that of the truth, shape (3,)."""
    absolute = ate(true, trajectory)
    return {"ate": _figures(absolute), "rpe": _figures(rpe(true, trajectory))}, absolute.pose_truth_estimate


def _survey_report(
    surveyed: NDArray[np.int64], positions: Array, identities: NDArray[np.int64], landmarks: Array, alignment: Pose
) -> dict[str, float]:
    """Landmarks against surveyed ones, rigidly aligned with those that they are.

    Those of known identity are the surveyed ones of the same. The others are matched where the alignment puts them,
    which the matches then improve, until they stay as they are.
    """
    truth = positions
    by_identity = np.argwhere((surveyed[:, None] == identities[None, :]) & (identities >= 0))
    pairs = by_identity
    for _ in range(MOST_MATCHINGS):
        if len(pairs):
            alignment = align(truth[pairs[:, 0]], landmarks[pairs[:, 1]])
        if len(by_identity):
            break
        matched = match_landmarks(truth, transform(alignment, landmarks), SURVEY_DISTANCE)
        if np.array_equal(matched, pairs):
            break
        pairs = matched
    report: dict[str, float] = {"surveyed": len(surveyed), "surveyed_mapped": len(pairs), "mapped": len(landmarks)}
    if len(pairs):
        errors = transform(alignment, landmarks[pairs[:, 1]]) - truth[pairs[:, 0]]
        report["rmse_m"] = _root_mean_square(np.linalg.norm(errors, axis=1))
    return report


def to_lines(report: Report) -> list[str]:
    """Report for a person, one figure a line."""
    return [
        f"{against:10s} {name:22s} {value:g}" if isinstance(value, int) else f"{against:10s} {name:22s} {value:.4f}"
        for against, figures in report.items()
        for name, value in figures.items()
    ]


@dataclass(frozen=True, slots=True)
class SimulationReport:
    """A simulated run against its truth, after rigid alignment of the trajectory.

    Parameters
    ----------
    ate_rmse_m, wheels_ate_rmse_m : of the final trajectory and of the wheels alone [m].
    landmark_rmse_m : over the landmarks that are corners of the world [m]; None where there are none.
    corners, corners_mapped : corners of the world, and how many of them are on the map.
    """

    ate_rmse_m: float
    wheels_ate_rmse_m: float
    landmark_rmse_m: float | None
    corners: int
    corners_mapped: int


def evaluate_simulated(source: "SimulatedRun", result: SlamResult) -> SimulationReport:
    """Compare a simulated run with its truth."""
    truth = Trajectory(source.stamps, source.poses_world_robot)
    absolute = ate(truth, result.trajectory)
    corners = source.world.corners
    errors = _landmark_errors(corners, transform(absolute.pose_truth_estimate, result.landmarks.positions))
    return SimulationReport(
        ate_rmse_m=absolute.rmse_m,
        wheels_ate_rmse_m=ate(truth, result.wheel_odometry).rmse_m,
        landmark_rmse_m=_root_mean_square(errors) if len(errors) else None,
        corners=len(corners),
        corners_mapped=len(errors),
    )


def _landmark_errors(corners: Array, landmarks: Array) -> Array:
    """Distances [m] of the landmarks that are corners from these, shape (m,); shapes (k, 2) and (n, 2) [m]."""
    pairs = match_landmarks(corners, landmarks, CORNER_DISTANCE)
    return np.linalg.norm(corners[pairs[:, 0]] - landmarks[pairs[:, 1]], axis=1)


def _root_mean_square(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def _figures(error: Ate | Rpe | RelationError) -> dict[str, float]:
    figures = asdict(error)
    figures.pop("pose_truth_estimate", None)
    return figures
