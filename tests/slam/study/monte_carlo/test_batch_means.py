"""Figures of runs in the frame of the start: by hand, and intervals of means against what they are of."""

import numpy as np
import pytest

from features.se2 import Array
from sim import World
from slam.map.landmark_map import LandmarkMap
from slam.study.monte_carlo.batch_means import MEANS, batch_means, batch_means_table, landmark_figures
from slam.study.monte_carlo.runs import MonteCarloSettings, run_task, simulated_run, study_config
from slam.study.tasks.run import task_seed

SQUARE = World.from_polygons("square", [[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]])


class Landmarks:
    """Positions and covariances of landmarks, all that figures are made of."""

    def __init__(self, positions: Array, covs: Array) -> None:
        self.positions, self.covs = positions, covs


def figures(offsets: list[tuple[float, float]], sigma: float) -> dict[str, float | None]:
    """Compare landmarks that lie beside the corners of the square in turn."""
    positions = np.array([SQUARE.corners[k % 4] + offset for k, offset in enumerate(offsets)]).reshape(-1, 2)
    covs = np.tile(sigma**2 * np.eye(2), (len(offsets), 1, 1))
    landmarks: LandmarkMap = Landmarks(positions, covs)  # type: ignore[assignment]
    return landmark_figures(SQUARE, landmarks)


def test_landmarks_are_compared_with_the_nearest_corner_where_they_lie() -> None:
    """One that is far from every corner counts as none and as outside its gate, but not among the errors."""
    found = figures([(0.01, 0.0), (0.0, -0.02), (0.05, 0.0), (0.3, 0.3)], sigma=0.01)
    assert found["landmarks_no_corner"] == 0.25
    assert found["landmarks_outside_99"] == 0.5  # 25 and 1800 against 9.2
    assert found["landmark_nees_half"] == pytest.approx((1.0 + 4.0 + 25.0) / 3.0 / 2.0)
    assert found["landmark_rms_m"] == pytest.approx(np.sqrt((1.0 + 4.0 + 25.0) / 3.0) * 0.01)
    assert found["landmark_claimed_m"] == pytest.approx(np.sqrt(2.0) * 0.01)


def test_a_run_without_landmarks_has_no_figures_of_them() -> None:
    assert set(figures([], sigma=0.01).values()) == {None}


def result(landmark: float | None, pose: list[float] | None) -> dict[str, object]:
    row = {name: landmark for name in MEANS if name.startswith("landmark")}
    return {"row": row, "nees_ekf": pose, "nees_graph": None}


def test_a_run_is_one_sample_however_much_it_has_of_a_figure() -> None:
    means = batch_means([result(1.0, [3.0] * 20), result(3.0, [9.0, 9.0]), result(None, None)])
    assert means["landmark_nees_half"] is not None
    assert means["nees_ekf"] is not None
    for of in (means["landmark_nees_half"], means["nees_ekf"]):
        assert (of["runs"], of["mean"]) == (2, 2.0)
        # Student's t of one degree of freedom: 12.706; the standard error of 1 and 3 is 1.
        assert of["interval_95"] == pytest.approx([2.0 - 12.706, 2.0 + 12.706], abs=1e-3)
    assert means["nees_graph"] is None
    table = batch_means_table(means)
    assert len(table) == 1 + len(MEANS)
    assert table[-1][1:] == ["-", "1", "-"]


def test_the_interval_holds_the_expectation_in_95_of_100_studies() -> None:
    """Of 400 studies of ten runs; the bounds are three standard deviations of the count."""
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(400):
        of = batch_means([result(None, [value]) for value in (3.0 + rng.standard_normal(10)).tolist()])["nees_ekf"]
        assert of is not None
        held += of["interval_95"][0] < 1.0 < of["interval_95"][1]
    assert 367 <= held <= 393


def test_another_room_in_each_run() -> None:
    settings = MonteCarloSettings(world="random-room-*", seeds=2, config=study_config())
    names = [simulated_run(settings, 5, run).name for run in (0, 1)]
    assert names == ["random-room-10000", "random-room-10001"]


@pytest.mark.slow
def test_a_run_through_a_cluttered_room_has_its_figures() -> None:
    settings = MonteCarloSettings(
        world="cluttered-room-*", sensor="rplidar-a1", effects="on", odometry="slipping", seeds=1, scans=40,
        config=study_config(sensor="rplidar-a1"),
    )  # fmt: skip
    row = run_task(settings, 3, task_seed(1, 3))["row"]
    assert row["world"] == "cluttered-room-10003"
    assert row["landmarks"] >= 2
    assert 0.0 <= row["landmarks_no_corner"] <= 1.0
    assert row["landmark_nees_half"] > 0.0


def test_the_true_noise_is_that_of_the_settings_and_the_preset_by_default() -> None:
    room = {"world": "room", "seeds": 1, "config": study_config()}
    assert simulated_run(MonteCarloSettings.model_validate(room), 1).lidar.sigma_range == 0.02
    noisy = MonteCarloSettings.model_validate(room | {"sigma_range_mm": 40.0})
    assert simulated_run(noisy, 1).lidar.sigma_range == 0.04
