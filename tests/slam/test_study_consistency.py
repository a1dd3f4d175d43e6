"""The study of two-wall corners: its scenes, that a seed repeats it, and what it shows."""

from pathlib import Path

import numpy as np
import pytest

from slam.study.consistency import (
    SWEEPS,
    ConsistencySettings,
    Scene,
    consistency_lines,
    consistency_rows,
    consistency_summary,
    measure,
    noisy_walls,
    scenes,
)
from slam.study.methods import METHODS, Method
from slam.study.output import write_csv
from slam.study.plot import draw_consistency

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


def test_the_study_repeats_to_the_byte_and_draws(tmp_path: Path) -> None:
    folder = tmp_path
    settings = ConsistencySettings(trials=3, seed=5)
    for name in ("one.csv", "two.csv"):
        rows = consistency_rows(settings)
        write_csv(folder / name, rows)
    assert (folder / "one.csv").read_bytes() == (folder / "two.csv").read_bytes()
    assert len(rows) == len(METHODS) * len(list(scenes(settings)))
    assert len(consistency_lines(consistency_summary(rows))) == len(METHODS) + 1
    draw_consistency(folder / "page.png", settings, rows)
    assert (folder / "page.png").read_bytes().startswith(b"\x89PNG")
