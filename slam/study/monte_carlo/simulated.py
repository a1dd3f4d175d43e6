"""One simulated run through the whole pipeline, held against its truth: errors, consistency, associations."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose, between, transform, wrap_angle
from sim import Measurement, SimulatedRun
from slam.config import SlamConfig
from slam.errors import DivergedError
from slam.evaluation.evaluate import evaluate_simulated
from slam.evaluation.metrics import ate, nees
from slam.filter.landmark_table import MERGED, REMOVED
from slam.map.landmark_map import LandmarkMap
from slam.pipeline import Slam
from slam.result.trajectory import Trajectory
from slam.step import Step
from slam.study.monte_carlo.batch_means import landmark_figures
from slam.study.monte_carlo.truth import AssociationScore, ClosureScore, true_corners

INSTANTS = 20
"""A run is held against its truth so many times, at equal intervals, the last time at its end."""


def simulate(source: SimulatedRun, config: SlamConfig, scans: int = 0) -> dict[str, Any]:
    """Run SLAM on a simulated robot and compare.

    Parameters
    ----------
    source : the run, with its truth.
    config : of SLAM.
    scans : stop after so many; 0 for all.

    Returns
    -------
    ``row`` with the figures of the run, and NEES of the pose at :data:`INSTANTS` by the filter (``nees_ekf``) and by
    the graph (``nees_graph``, None where it has no unique solution).

    Raises
    ------
    DivergedError
        The filter diverged.
    """
    slam = Slam(config)
    steps: list[Step] = []
    measurements: list[Measurement | None] = []
    for frame, measurement in source.measured_frames():
        measurements.append(measurement)
        step = slam.process(frame)
        # With the noise of the sensor all before may have been done anew.
        steps[: len(step.before)] = step.before
        steps.append(step)
        if slam.scans == scans > 0:
            break
    records = len(steps)
    result = slam.finish()
    score, nis, nis_dof = AssociationScore(), 0.0, 0
    updates: list[int] = []
    errors: list[Pose] = []
    covs: list[Array] = []
    for record, (step, measurement) in enumerate(zip(steps, measurements, strict=True)):
        if step.association is None or step.features is None or step.cov is None or measurement is None:
            continue
        # The pose of a scan is that in the middle of its sweep.
        truth = source.trajectory.at(np.array([step.stamp]))[0]
        corners = step.features.corners.to_robot(source.mounting).positions
        labels = true_corners(source.world, measurement, step.features, transform(truth, corners))
        score.count(step.association, labels)
        if matches := len(step.association.corners):
            nis += step.association.nis
            nis_dof += 2 * matches
        error: Array = step.pose_world_robot - truth
        updates.append(record)
        errors.append(np.array([error[0], error[1], wrap_angle(float(error[2]))]))
        covs.append(step.cov)
    report = evaluate_simulated(source, result)
    instants = np.arange(1, INSTANTS + 1) * (records - 1) / INSTANTS
    latest = np.searchsorted(updates, instants, side="right") - 1
    landmarks = score.corners()[result.landmarks.ids]
    genuine = landmarks[landmarks >= 0]
    key_poses = source.trajectory.at(slam.key_frame_stamps)
    closures = ClosureScore.of(slam.closures, slam.solution.estimate.revoked, key_poses)
    lives = slam.landmark_table.key_frames
    row = {
        "ate_online_m": ate(Trajectory(source.stamps, source.poses_world_robot), result.trajectory_online).rmse_m,
        "ate_final_m": report.ate_rmse_m,
        "ate_wheels_m": report.wheels_ate_rmse_m,
        "landmark_rmse_m": report.landmark_rmse_m,
        "nis": nis,
        "nis_dof": nis_dof,
        "association_precision": score.precision(),
        "association_recall": score.recall(),
        "landmarks": len(landmarks),
        "duplicates": (duplicates := len(genuine) - len(set(genuine.tolist()))),
        "duplicates_share": duplicates / max(1, len(landmarks)),
        "false_landmarks": len(landmarks) - len(genuine),
        "corners_mapped": report.corners_mapped,
        "landmark_nees": _landmark_nees(source, result.landmarks, landmarks),
        "landmarks_born": len(lives),
        "landmarks_merged": int((lives == MERGED).sum()),
        "landmarks_ended": int((lives == REMOVED).sum()),
        "closures": closures.accepted,
        "closures_revoked": closures.revoked,
        "closures_false": closures.false,
        "closure_nees": float(closures.nees.mean()) if len(closures.nees) else None,
        "key_frames": result.metrics.key_frames,
        "graph_converged": result.metrics.graph_converged,
    }
    return {
        "row": row | landmark_figures(source.world, result.landmarks),
        "nees_ekf": nees(np.array(errors)[latest], np.array(covs)[latest]).tolist(),
        "nees_graph": _graph_nees(slam, key_poses, instants),
    }


def _landmark_nees(source: SimulatedRun, landmarks: LandmarkMap, corners: NDArray[np.int64]) -> float | None:
    """Mean NEES of the landmarks that are corners, in the world frame, which is that of the first true pose."""
    genuine = np.flatnonzero((corners >= 0) & np.isfinite(landmarks.covs).all(axis=(1, 2)))
    if not len(genuine):
        return None
    errors = landmarks.positions[genuine] - source.world.corners[corners[genuine]]
    return float(nees(errors, landmarks.covs[genuine]).mean())


def _graph_nees(slam: Slam, key_poses: Array, instants: Array) -> list[float] | None:
    """NEES of the key frame at each instant or the last one before it, given the true pose of each key frame."""
    latest = np.searchsorted(slam.key_frame_records, instants, side="right") - 1
    try:
        covs = slam.solution.pose_covs(latest)
    except DivergedError:
        return None
    estimates = slam.solution.estimate.poses_world_robot[latest]
    errors = [between(pose, truth) for pose, truth in zip(estimates, key_poses[latest], strict=True)]
    return nees(np.array(errors), covs).tolist()
