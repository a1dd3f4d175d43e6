"""Simulated runs against their truth: scores by hand, statistics against what they are of, and the summary."""

import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from features import extract, sensor_preset
from features.se2 import between, pose, transform
from sim import EFFECTS, Lidar, find_site, room_run, site_run
from slam.errors import StudyError
from slam.evaluation.evaluate import evaluate_simulated
from slam.evaluation.metrics import ate, mean_interval, nees
from slam.filter.association import Association, associate
from slam.graph.values import Closure
from slam.pipeline import Slam
from slam.result.trajectory import Trajectory
from slam.study.monte_carlo.bars import bars
from slam.study.monte_carlo.runs import (
    MonteCarloSettings,
    monte_carlo_lines,
    monte_carlo_summary,
    nees_rows,
    run_rows,
    run_task,
    simulated_run,
    study_config,
)
from slam.study.monte_carlo.simulated import INSTANTS, simulate
from slam.study.monte_carlo.truth import AssociationScore, ClosureScore, true_corners
from slam.study.tasks.run import Failure

CONFIG = study_config()
SCANS = 60


def associated(corners: list[int], landmarks: list[int], new: list[int]) -> Association:
    return Association(*(np.array(of, np.int64) for of in (corners, landmarks, new)))


def test_associations_are_scored_against_the_corner_that_a_landmark_is_mostly_seen_as() -> None:
    score = AssociationScore()
    assert score.precision() is None
    assert score.recall() is None
    score.count(associated([], [], [0, 1, 2]), np.array([7, 8, -1]))
    assert score.corners().tolist() == [7, 8, -1]
    # Right, wrong, one of no corner to a landmark of none, one that is left out, and one that is born a second time.
    score.count(associated([0, 1, 2], [0, 0, 2], [4]), np.array([7, 8, -1, 8, 7]))
    assert score.corners().tolist() == [7, 8, -1, 7]
    assert score.precision() == pytest.approx(1 / 3)
    assert score.recall() == pytest.approx(1 / 4)


def test_a_landmark_born_of_a_feigned_corner_is_the_edge_that_is_seen_there_later() -> None:
    score = AssociationScore()
    score.count(associated([], [], [0, 1]), np.array([-1, 5]))
    score.count(associated([0, 1], [0, 1], []), np.array([4, 4]))
    score.count(associated([0, 1], [0, 1], []), np.array([4, 5]))
    assert score.corners().tolist() == [4, 5]
    assert score.precision() == pytest.approx(3 / 4)
    assert score.recall() == pytest.approx(3 / 4)


@pytest.mark.slow
def test_a_corner_is_where_the_walls_meet_that_its_two_lines_hit_however_near_another_corner_is() -> None:
    """Niches of 0.35 m: of a corner whose position errs the nearest of all corners may be another one."""
    run = site_run(find_site("office-loop"), Lidar.of_preset("rplidar-s1"), "rplidar-s1", 1)
    sensor, labelled, moved = sensor_preset("rplidar-s1"), 0, 0
    for index, measurement in zip(range(0, 400, 5), itertools.islice(run.measurements(), 0, 400, 5), strict=True):
        truth = run.poses_world_robot[run.has_scan][index]
        features = extract(measurement.scan, sensor)
        seen_world = transform(truth, features.corners.positions)
        labels = true_corners(run.world, measurement, features, seen_world)
        labelled += int((labels >= 0).sum())
        corners = run.world.corners[labels[labels >= 0]]
        assert (np.hypot(*(corners - seen_world[labels >= 0]).T) <= 0.3).all()
        # Moved by 0.2 m, out of the niche, a corner keeps its name.
        again = true_corners(run.world, measurement, features, corners + np.array([0.0, 0.2]))
        assert again.tolist() == labels[labels >= 0].tolist()
        apart = np.hypot(*(run.world.corners - corners[:, None] - np.array([0.0, 0.2])).transpose(2, 0, 1))
        moved += int((apart.argmin(axis=1) != labels[labels >= 0]).sum())
    assert labelled > 200
    assert moved > 5


def test_closures_are_counted_against_the_truth() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 1.0, 3.1], [0.1, 0.0, -3.1]])
    right = Closure(0, 2, between(poses[0], poses[2]) + pose(0.02), 1e-4 * np.eye(3))
    turned = Closure(1, 2, between(poses[1], poses[2]) + np.array([0.0, 0.0, 2.0 * np.pi - 0.01]), 1e-4 * np.eye(3))
    wrong = Closure(0, 1, between(poses[0], poses[1]) + pose(0.0, 0.6), 1e-4 * np.eye(3))
    score = ClosureScore.of([right, turned, wrong], [], poses)
    assert (score.accepted, score.revoked, score.false) == (3, 0, 1)
    assert score.nees == pytest.approx([4.0, 1.0])
    score = ClosureScore.of([right, turned, wrong], [wrong], poses)
    assert (score.accepted, score.revoked, score.false) == (3, 1, 0)
    assert ClosureScore.of([], [], poses).nees.size == 0


def test_nees_of_right_covariances_has_the_mean_and_interval_of_chi_square() -> None:
    rng = np.random.default_rng(1)
    factor = rng.normal(size=(3, 3))
    cov = factor @ factor.T
    errors = rng.multivariate_normal(np.zeros(3), cov, size=4000)
    squares = nees(errors, np.broadcast_to(cov, (4000, 3, 3)))
    np.testing.assert_allclose(squares[:5], [e @ np.linalg.inv(cov) @ e for e in errors[:5]], rtol=1e-9)
    # Of 400 means of ten, 95 % are in their interval; the share has a standard deviation of 1.1 %, three of them here.
    low, high = mean_interval(3, 10)
    means = squares.reshape(-1, 10).mean(axis=1)
    assert abs(np.mean((means > low) & (means < high)) - 0.95) < 0.033
    assert mean_interval(3, 1, 0.9) == pytest.approx(chi2.interval(0.9, 3))


@pytest.fixture(scope="module")
def run() -> dict[str, Any]:
    return simulate(room_run(5), CONFIG, SCANS)


def test_a_run_is_held_against_its_truth(run: dict[str, Any]) -> None:
    """The figures are those of the pipeline run without being watched; NEES of the last update is made by hand."""
    source = room_run(5)
    slam = Slam(CONFIG)
    for record, frame in enumerate(source):
        step = slam.process(frame)
        if step.association is not None:
            filter_error = slam.filter.pose - source.poses_world_robot[record]
            filter_cov = slam.filter.pose_cov
        if slam.scans == SCANS:
            break
    result = slam.finish()
    row = run["row"]
    truth = Trajectory(source.stamps, source.poses_world_robot)
    assert row["ate_online_m"] == ate(truth, result.trajectory_online).rmse_m
    assert row["ate_final_m"] == evaluate_simulated(source, result).ate_rmse_m
    assert row["landmarks"] == len(result.landmarks)
    assert run["nees_ekf"][-1] == pytest.approx(filter_error @ np.linalg.solve(filter_cov, filter_error))
    last = len(slam.key_frame_records) - 1
    error = between(
        slam.solution.estimate.poses_world_robot[last], source.poses_world_robot[slam.key_frame_records[last]]
    )
    assert run["nees_graph"][-1] == pytest.approx(
        error @ np.linalg.solve(slam.solution.pose_covs(np.array([last]))[0], error), rel=1e-6
    )
    assert len(run["nees_ekf"]) == len(run["nees_graph"]) == INSTANTS


def test_a_quiet_room_is_associated_without_fault(run: dict[str, Any]) -> None:
    row = run["row"]
    assert (row["association_precision"], row["association_recall"]) == (1.0, 1.0)
    assert (row["duplicates"], row["false_landmarks"]) == (0, 0)
    # Two coordinates of ten corners or more at each of some fifty updates: the mean is within 10 % of 1 by far, were it
    # not that the odometry is better than the filter is told.
    assert 0.7 < row["nis"] / row["nis_dof"] < 1.1


def test_associations_that_go_wrong_are_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each matched corner is given to the landmark of its neighbour."""

    def exchanged(*arguments: Any) -> Association:
        found = associate(*arguments)
        return replace(found, landmarks=np.roll(found.landmarks, 1))

    monkeypatch.setattr("slam.filter.front_end.associate", exchanged)
    assert simulate(room_run(5), CONFIG, 10)["row"]["association_precision"] < 0.2


def test_the_settings_of_a_study_say_which_world_it_is_and_runs_refuse_another(tmp_path: Path) -> None:
    world = tmp_path / "square.json"

    def write(side: float) -> None:
        square = {"points": [[0, 0], [side, 0], [side, 4], [0, 4]], "closed": True}
        content = {"format": "cwlf-world", "version": 1, "walls": [square], "waypoints": [[1, 1], [2, 1]]}
        world.write_text(json.dumps(content))

    write(4.0)
    settings = MonteCarloSettings(world=str(world), seeds=1, scans=3, config=CONFIG)
    assert settings == MonteCarloSettings(world=str(world), seeds=1, scans=3, config=CONFIG)
    assert run_task(settings, 0, 5)["row"]["landmarks"] <= 4
    write(4.5)
    with pytest.raises(StudyError, match="is not the one that the study was begun with"):
        run_task(settings, 0, 5)
    assert MonteCarloSettings(world=str(world), seeds=1, config=CONFIG).world_digest != settings.world_digest


def test_effects_wheels_and_people_are_those_of_the_settings() -> None:
    settings = MonteCarloSettings(
        world="apartment", seeds=1, effects="rplidar-s1", odometry="exact", people=2, config=CONFIG
    )
    run = simulated_run(settings, 3)
    assert run.lidar.effects == EFFECTS["rplidar-s1"]
    np.testing.assert_allclose(run.poses_odom_robot[-1], run.poses_world_robot[-1], atol=1e-6)
    assert len(run.people) == 2


def results(count: int, scale: float, seed: int) -> list[dict[str, Any]]:
    """Runs whose pose errors are as large as claimed, or ``scale`` times so."""
    rng = np.random.default_rng(seed)
    return [
        {
            "row": {
                "run": number,
                "seed": number,
                "ate_online_m": 0.001 * (number + 1),
                "ate_final_m": 0.001,
                "landmark_rmse_m": None if number == 0 else 0.002,
                "nis": float(scale**2 * rng.chisquare(400)),
                "nis_dof": 400,
                "association_precision": 1.0 - 0.01 * number,
                "association_recall": 1.0,
                "landmarks": 10,
                "duplicates": 0,
                "duplicates_share": 0.0,
                "false_landmarks": 0,
                "landmarks_born": 12,
                "landmarks_merged": 1,
                "landmarks_ended": 1,
                "landmark_nees": 2.0 * scale**2,
                "landmark_nees_half": float(scale**2 * rng.chisquare(40) / 40.0),
                "landmarks_outside_99": 0.01,
                "landmarks_no_corner": 0.0,
                "landmark_rms_m": 0.002 * scale,
                "landmark_claimed_m": 0.002,
                "closures": 3,
                "closures_revoked": 0,
                "closures_false": 0,
                "closure_nees": None if number == 2 else 3.0,
                "graph_converged": number != 3,
            },
            "nees_ekf": (scale**2 * rng.chisquare(3, INSTANTS)).tolist(),
            "nees_graph": None if number == 1 else rng.chisquare(3, INSTANTS).tolist(),
        }
        for number in range(count)
    ]


@pytest.mark.parametrize(("scale", "consistent"), [(1.0, True), (1.3, False)])
def test_the_summary_tells_right_covariances_from_wrong_ones(scale: float, consistent: bool) -> None:
    lot = results(100, scale, seed=2)
    summary = monte_carlo_summary(MonteCarloSettings(world="room", seeds=100, config=CONFIG), lot, [])
    for of in (summary["nees"]["pose, filter"], summary["nis"]):
        low, high = of["interval_95"]
        assert (low < of["mean"] < high) == consistent
    assert (summary["nees"]["pose, filter"]["instants_inside"] > 0.8) == consistent
    assert summary["nees"]["pose, graph"]["runs"] == 99
    assert summary["graph_not_converged"] == 1
    errors = summary["figures"]["ate_online_m"]
    assert (errors["mean"], errors["p95"], errors["worst"]) == pytest.approx((0.0505, 0.09505, 0.1))
    assert summary["figures"]["association_precision"]["worst"] == pytest.approx(0.01)
    assert summary["figures"]["landmark_rmse_m"]["runs"] == 99
    assert any("95.05" in line for line in monte_carlo_lines(summary))


@pytest.mark.parametrize(
    ("change", "missed"),
    [
        ({}, set()),
        ({"ate_final_m": 0.051}, {"ATE, final, worst run [mm]"}),
        ({"association_precision": 0.9}, {"association precision [%]"}),
        ({"association_recall": 0.5}, {"association recall [%]"}),
        ({"duplicates_share": 1.0}, {"duplicates [%]"}),
        ({"closures_false": 1}, {"false closures"}),
        ({"landmark_rmse_m": 0.041}, {"landmark RMSE, worst run [mm]"}),
        ({"graph_converged": False}, {"graphs without convergence"}),
    ],
)
def test_one_bad_run_misses_the_bar_it_is_bad_in(change: dict[str, Any], missed: set[str]) -> None:
    lot = results(20, 1.0, seed=4)
    for run in lot:
        run["row"] |= {"association_precision": 1.0, "association_recall": 0.96, "graph_converged": True}
    lot[7]["row"] |= change
    summary = monte_carlo_summary(MonteCarloSettings(world="room", seeds=20, config=CONFIG), lot, [])
    assert {bar.cells()[0] for bar in bars(summary) if not bar.holds} == missed
    assert sum("MISSED" in line for line in monte_carlo_lines(summary)) == len(missed)


def test_wrong_covariances_and_failed_runs_miss_their_bars() -> None:
    summary = monte_carlo_summary(
        MonteCarloSettings(world="room", seeds=21, config=CONFIG), results(20, 1.5, seed=5), [Failure(3, 4, "lost", "")]
    )
    missed = {bar.label for bar in bars(summary) if not bar.holds}
    assert {"runs that failed", "pose NEES, filter"} <= missed


def test_tables_have_a_row_per_run_and_per_instant() -> None:
    lot = results(8, 1.0, seed=3)
    rows, traces = run_rows(lot), nees_rows(lot)
    assert [row["nees_graph"] is None for row in rows] == [number == 1 for number in range(8)]
    assert rows[2]["nis"] == pytest.approx(lot[2]["row"]["nis"] / 400)
    assert len(traces) == 2 * INSTANTS
    assert traces[0]["nees"] == pytest.approx(np.mean([result["nees_ekf"][0] for result in lot]))
    assert (traces[0]["low_95"], traces[0]["high_95"]) == pytest.approx(mean_interval(3, 8))
