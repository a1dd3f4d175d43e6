"""The timing study: its compiled steps compute what the extraction computes, and its tables are whole."""

from pathlib import Path

import numpy as np
import pytest

from features import SensorModel, fit_line, intersect
from slam.study.paper import timing
from slam.study.paper.report import study_timing
from slam.study.paper.timing import FORMS, STEPS, TimingSettings, measurements, paper_corner
from slam.study.paper.timing_kernels import CWLF, run_steps

SETTINGS = TimingSettings(repeats=1, lot_ms=0.01)


@pytest.mark.parametrize("environment", ["A", "B"])
@pytest.mark.parametrize("form", list(FORMS))
def test_the_steps_give_the_corner_and_covariance_of_the_extraction(environment: str, form: str) -> None:
    scene = paper_corner(environment, SETTINGS, 50)
    walls = measurements(scene, seed=2)
    model = SensorModel(1e-3 * scene.sigma_range_mm, np.radians(scene.sigma_bearing_deg), 0.0, 100.0)
    number = FORMS[form][1]
    fit = ("cwlf", "paper") if number == CWLF else ("arras-siegwart", "propagated")
    expected, expected_cov = intersect(*(fit_line(wall[2], wall[3], model, *fit) for wall in walls))
    corner, cov = np.zeros(2), np.zeros(3)
    variances = model.sigma_range**2, model.sigma_bearing**2
    run_steps(number, 0, 3, 1, *walls, *variances, np.zeros((2, 8)), np.zeros((2, 3)), corner, cov)
    np.testing.assert_allclose(corner, expected, atol=1e-9)
    np.testing.assert_allclose(cov[[0, 2, 2, 1]].reshape(2, 2), expected_cov, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("environment", "angle"), [("A", 130.0), ("B", 90.0)])
def test_the_corners_are_those_of_the_paper(environment: str, angle: float) -> None:
    scene = paper_corner(environment, SETTINGS, 100)
    assert scene.corner_angle_deg == pytest.approx(angle, abs=0.1)
    assert 0.0 < scene.incidence_deg < scene.corner_angle_deg
    assert measurements(scene, 1)[0].shape == (4, 50)


@pytest.mark.slow
def test_the_study_writes_its_tables_and_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "COUNTS", (10, 20))
    monkeypatch.setattr(timing, "TRIALS", 20)
    lines = study_timing(tmp_path, SETTINGS)
    assert len(lines) == 1 + 2 + 1 + 2 * 2 * len(FORMS) + 1 + 2 * 2 * 5
    assert len((tmp_path / "figure_3.csv").read_text().splitlines()) == 3
    assert len((tmp_path / "steps.csv").read_text().splitlines()) == 1 + 2 * 2 * len(FORMS) * len(STEPS)
    for number in (3, 4, 5):
        assert (tmp_path / f"figure_{number}.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in tmp_path.iterdir()} >= {"uncertainty.csv", "summary.json", "settings.toml"}
