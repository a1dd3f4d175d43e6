"""The commands ``study`` and ``extract`` as a user meets them."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import Call
from distributed import Client

from features.se2 import pose
from sim import Lidar, SimulatedRun, room, room_run
from slam.errors import DivergedError
from slam.study.monte_carlo import simulated
from slam.study.monte_carlo.runs import study_config
from slam.study.tasks.run import task_seed


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Three scans of the room by a scanner that sees 180 degrees."""
    lidar, rng = Lidar.of_preset("sick-lms"), np.random.default_rng(0)
    lines = []
    for stamp in range(3):
        ranges = np.minimum(lidar.scan(room(), pose(2.2, 1.7, 0.8), 0.0, rng).ranges, 81.83)
        readings = " ".join(f"{value:.3f}" for value in ranges)
        lines.append(f"FLASER 180 {readings} 0 0 0 0 0 0 {stamp} host {stamp}\n")
    path = tmp_path / "room.log"
    path.write_text("".join(lines))
    return path


@pytest.mark.slow
def test_a_study_prints_its_summary_and_fills_its_folder(cwlf: Call, client: Client, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    command = ("study", "corners", "--environment", "A", "--scans", 3, "--sigma-range-mm", 10, "--out", folder)
    command += ("--scheduler", client.scheduler.address)
    code, out, _ = cwlf(*command)
    assert code == 0
    assert "23.02 / 18.27" in out
    assert {path.name for path in folder.iterdir()} == {"corners.csv", "summary.json", "corners.png", "settings.toml"}
    code, _, err = cwlf(*command)
    assert code == 1
    assert "--overwrite" in err
    assert cwlf(*command, "--overwrite")[0] == 0


@pytest.mark.slow
def test_the_study_of_trust_prints_its_rates_and_fills_its_folder(cwlf: Call, client: Client, tmp_path: Path) -> None:
    folder = tmp_path / "study"
    command = ("study", "trust", "--runs", 1, "--faulty", 1, "--limit", 5, "--out", folder)
    code, out, _ = cwlf(*command, "--scheduler", client.scheduler.address)
    assert code == 0
    assert "1 runs without and 1 with a fault, 0 failed" in out
    assert {path.name for path in folder.iterdir()} == {"runs.csv", "summary.json", "page.md", "settings.toml"}


def test_a_study_of_trust_without_runs_is_bad_usage(cwlf: Call) -> None:
    code, _, err = cwlf("study", "trust", "--runs", 0, "--faulty", 0)
    assert code == 2
    assert "at least one" in err


def test_an_environment_that_is_not_there_is_bad_usage(cwlf: Call) -> None:
    assert cwlf("study", "corners", "--environment", "C")[0] == 2
    assert cwlf("study", "corners")[0] == 2


@pytest.mark.parametrize(("study", "sensor"), [("corners --environment cluttered", "moon"), ("slam", "mrclam-camera")])
def test_a_sensor_that_is_no_laser_scanner_is_one_line(cwlf: Call, study: str, sensor: str) -> None:
    code, _, err = cwlf("study", *study.split(), "--sensor", sensor)
    assert code == 1
    assert err.startswith("cwlf-slam: --sensor: ")
    assert len(err.splitlines()) == 1


def test_a_scheduler_has_its_own_workers(cwlf: Call) -> None:
    code, _, err = cwlf("study", "consistency", "--scheduler", "tcp://127.0.0.1:9", "--workers", 2)
    assert code == 2
    assert "--workers" in err


def test_a_scheduler_that_is_not_there_is_one_line(cwlf: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slam.study.tasks.run.CONNECT_S", 0.1)
    code, _, err = cwlf("study", "consistency", "--scheduler", "tcp://127.0.0.1:9", "--out", tmp_path / "study")
    assert code == 1
    assert err.startswith("cwlf-slam: no dask scheduler answers at tcp://127.0.0.1:9")
    assert not (tmp_path / "study").exists()


def test_a_world_that_is_not_there_is_one_line(cwlf: Call, tmp_path: Path) -> None:
    code, _, err = cwlf("study", "slam", "--world", "moon", "--out", tmp_path / "study")
    assert code == 1
    assert err.startswith("cwlf-slam: no world and no file 'moon': built in are room, ")
    assert len(err.splitlines()) == 1
    assert not (tmp_path / "study").exists()


@pytest.mark.slow
def test_an_interrupted_study_says_how_to_go_on(
    cwlf: Call, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    command = ("study", "corners", "--environment", "A", "--scans", 60, "--out", tmp_path / "study")
    command += ("--scheduler", client.scheduler.address)
    with monkeypatch.context() as patched:
        patched.setattr("slam.study.paper.report.collect_results", interrupted)
        code, _, err = cwlf(*command)
    assert code == 130
    assert "the same command goes on" in err
    code, _, err = cwlf(*command)
    assert code == 0
    assert "2 of 2 tasks are done" in err


@pytest.mark.slow
def test_a_run_that_fails_is_told_and_the_others_are_summarised(
    cwlf: Call, client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def simulate(source: SimulatedRun, *_: object) -> dict[str, object]:
        if source.poses_odom_robot[-1].tolist() == lost:
            raise DivergedError("lost")
        return done

    lost = room_run(task_seed(1, 1)).poses_odom_robot[-1].tolist()
    done = simulated.simulate(room_run(1), study_config(), 5)
    monkeypatch.setattr("slam.study.monte_carlo.runs.simulate", simulate)
    folder = tmp_path / "study"
    code, out, err = cwlf("study", "slam", "--seeds", 3, "--out", folder, "--scheduler", client.scheduler.address)
    assert code == 1
    assert "2 runs through room, 1 failed" in out
    assert "1 of 3 tasks failed" in err
    assert json.loads((folder / "summary.json").read_text())["failures"] == [
        {"run": 1, "seed": task_seed(1, 1), "error": "DivergedError: lost"}
    ]


def test_extract_prints_lines_and_corners_and_draws(cwlf: Call, log: Path, tmp_path: Path) -> None:
    code, out, _ = cwlf("extract", log, "--scan", 2, "--plot", tmp_path / "scan.png")
    assert code == 0
    assert "stamp 2.000000, 180 beams" in out
    assert "3 corners" in out
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("number", [3, 1000])
def test_a_scan_beyond_the_log_is_one_line(cwlf: Call, log: Path, number: int) -> None:
    code, _, err = cwlf("extract", log, "--scan", number)
    assert code == 1
    assert err.strip() == f"cwlf-slam: room: there is no scan {number}: the log has 3, 0 to 2"


def test_a_picture_that_cannot_be_written_is_one_line(cwlf: Call, log: Path, tmp_path: Path) -> None:
    code, _, err = cwlf("extract", log, "--scan", 0, "--plot", tmp_path / "not-there" / "scan.png")
    assert code == 1
    assert len(err.strip().splitlines()) == 1
