"""The study of two-wall corners: its scenes, that a seed repeats it, and what it shows."""

from pathlib import Path

import numpy as np
import pytest
from distributed import Client

from slam.study.output import write_csv
from slam.study.paper.consistency import (
    SWEEPS,
    ConsistencySettings,
    Scene,
    consistency_rows,
    measure,
    noisy_walls,
    scene_task,
    scenes,
)
from slam.study.paper.methods import METHODS, Method
from slam.study.paper.report import study_consistency
from slam.study.tasks.run import task_seed

QUIET = Scene(1e-9, 1e-9, 0.391, 2.0, 4.0, 90.0, 30.0)


@pytest.mark.parametrize("bearing", [0.0, 77.0])
def test_walls_without_noise_meet_in_the_corner_at_their_angle(bearing: float) -> None:
    scene = Scene(1e-9, 1e-9, 0.391, 2.0, 4.0, 130.0, 50.0, bearing_deg=bearing)
    directions = []
    corner = 4.0 * np.array([np.cos(np.radians(bearing)), np.sin(np.radians(bearing))])
    for ranges, angles in noisy_walls(scene, 1, np.random.default_rng(0)):
        points = ranges[0, :, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        away = points - corner
        assert np.hypot(*away.T).max() <= 2.0
        directions.append(away[-1] / np.hypot(*away[-1]))
        # All points lie on one ray from the corner.
        np.testing.assert_allclose(np.abs(away @ np.array([-directions[-1][1], directions[-1][0]])), 0.0, atol=1e-7)
    assert np.degrees(np.arccos(directions[0] @ directions[1])) == pytest.approx(130.0, abs=1e-4)
    assert np.degrees(np.arccos(directions[0] @ (-corner / 4.0))) == pytest.approx(50.0, abs=1e-4)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.key)
def test_every_method_finds_a_quiet_corner(method: Method) -> None:
    assert measure(QUIET, 3, np.random.default_rng(0), method)["rms_mm"] < 1e-4


def test_each_sweep_changes_its_value_and_every_value_is_there() -> None:
    listed = list(scenes(ConsistencySettings()))
    for sweep, (_, values) in SWEEPS.items():
        mine = [(value, scene) for name, value, _, scene in listed if name == sweep]
        assert [value for value, _ in mine] == list(values)
        assert all(getattr(scene, sweep) == value for value, scene in mine)


@pytest.mark.parametrize("sigma_mm", [10.0, 50.0])
def test_consistent_methods_are_near_one_and_the_papers_is_not(sigma_mm: float) -> None:
    """Of 600 corners the mean NEES/2 has a standard deviation of 0.04; findings, section 1, has the same scene."""
    scene = Scene(sigma_mm, 0.113, 0.391, 2.0, 4.0, 90.0, 45.0)
    half = {
        method.key: measure(scene, 600, np.random.default_rng(4), method)["nees_half"]
        for method in METHODS
        if method.key in {"effective-variance", "arras-siegwart", "cwlf-paper"}
    }
    assert 0.87 < half["effective-variance"] < 1.13
    assert 0.85 < half["arras-siegwart"] < 1.25
    assert half["cwlf-paper"] > 1.5


@pytest.mark.slow
def test_the_study_writes_what_its_tasks_yield_and_draws(tmp_path: Path, client: Client) -> None:
    settings = ConsistencySettings(trials=3, seed=5)
    lines = study_consistency(client, tmp_path, settings)
    assert len(lines) == len(METHODS) + 1
    count = len(list(scenes(settings)))
    results = [scene_task(settings, task, task_seed(5, task)) for task in range(count)]
    write_csv(tmp_path / "expected.csv", consistency_rows(settings, results))
    assert (tmp_path / "consistency.csv").read_bytes() == (tmp_path / "expected.csv").read_bytes()
    assert (tmp_path / "consistency.png").read_bytes().startswith(b"\x89PNG")


def test_a_task_measures_its_scene_by_all_methods() -> None:
    settings = ConsistencySettings(trials=4)
    listed = list(scenes(settings))
    results = [scene_task(settings, task, seed=task) for task in range(len(listed))]
    rows = consistency_rows(settings, results)
    task = 17
    sweep, value, second, scene = listed[task]
    for row, method in zip(rows[task * len(METHODS) :], METHODS, strict=False):
        expected = measure(scene, 4, np.random.default_rng(task), method)
        assert row == {"sweep": sweep, "value": value, "second": second, "method": method.key, **expected}
