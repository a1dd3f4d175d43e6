"""The command line as a user meets it: folders, messages, exit codes."""

import gzip
import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Call
from places import DATA

import slam.pictures.run_map
from drivers import CarmenLog, Frame
from sim import SimulatedRun, room_run
from slam.result.trajectory_file import read_trajectory_file

SCAN = "FLASER 8 1 1.1 1.2 1.3 1.4 1.5 1.6 1.7 0 0 0 {x} 0 0 {stamp} host {stamp}"
FILES = {
    "trajectory.tum",
    "trajectory_online.tum",
    "trajectory_odometry.tum",
    "landmarks.csv",
    "metrics.json",
    "config.toml",
    "map.png",
}


@pytest.fixture(scope="module")
def simulated() -> SimulatedRun:
    return room_run(3)


@pytest.fixture(scope="module")
def room_log(simulated: SimulatedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a part of a simulated run as a CARMEN log: ROBOTLASER1 records over the full turn, ODOM between."""
    lines = ["# simulated"]
    for number, frame in enumerate(simulated):
        if number == 1200:
            break
        x, y, theta = frame.pose_odom_robot
        pose = f"{x:.6f} {y:.6f} {theta:.6f}"
        tail = f"{frame.stamp:.6f} host {frame.stamp:.6f}"
        if frame.scan is None:
            lines.append(f"ODOM {pose} 0 0 0 {tail}")
        else:
            angles, ranges = frame.scan.angles, np.where(np.isfinite(frame.scan.ranges), frame.scan.ranges, 40.0)
            step = angles[1] - angles[0]
            readings = " ".join(f"{value:.4f}" for value in ranges)
            lines.append(
                f"ROBOTLASER1 0 {angles[0]:.9f} {step * len(angles):.9f} {step:.9f} 40 0.02 0 {len(ranges)} {readings} "
                f"0 {pose} {pose} 0 0 0 0 0 {tail}"
            )
    path = tmp_path_factory.mktemp("logs with space") / "room.log.gz"
    path.write_bytes(gzip.compress("\n".join(lines).encode() + b"\n"))
    return path


def write_log(path: Path, *lines: str) -> Path:
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


@pytest.mark.slow
def test_run_writes_a_complete_folder_and_evaluate_reads_it(
    cwlf: Call, room_log: Path, simulated: SimulatedRun, tmp_path: Path
) -> None:
    out = tmp_path / "run folder"
    outcome = cwlf("run", room_log, "--sensor", "rplidar-s1", "--out", out, "--seed", 5)
    assert outcome.code == 0
    # Where it takes long, because everything is compiled for the first time, progress is all there is to see.
    assert [line for line in outcome.err.splitlines() if "scans/s" not in line] == []
    assert {path.name for path in out.iterdir()} == FILES

    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["records"] == 1200
    assert metrics["scans"] == 240
    assert metrics["landmarks"] == len((out / "landmarks.csv").read_text().splitlines()) - 1 > 10
    for stage in ("extract", "front_end", "back_end"):
        assert 0.0 < metrics["stages"][stage]["mean_ms"] <= metrics["stages"][stage]["max_ms"]
    assert "seed = 5 " in (out / "config.toml").read_text()
    assert len(read_trajectory_file(out / "trajectory.tum")) == 1200
    assert len(read_trajectory_file(out / "trajectory_online.tum")) == 240

    truth = tmp_path / "truth.tum"
    truth.write_text(
        "".join(
            f"{stamp:.6f} {x:.9f} {y:.9f} 0 0 0 {np.sin(theta / 2):.12f} {np.cos(theta / 2):.12f}\n"
            for stamp, (x, y, theta) in zip(simulated.stamps, simulated.poses_world_robot, strict=True)
        )
    )
    report = json.loads(cwlf("evaluate", out, "--truth", truth, "--json").out)
    assert report["ate"]["rmse_m"] < 0.05
    assert report["rpe"]["translation_rmse_m"] < 0.05
    assert "rmse_m" in cwlf("evaluate", out, "--truth", truth).out

    again = tmp_path / "again"
    assert cwlf("run", room_log, "--config", out / "config.toml", "--out", again).code == 0
    assert (again / "trajectory.tum").read_bytes() == (out / "trajectory.tum").read_bytes()
    assert (again / "config.toml").read_bytes() == (out / "config.toml").read_bytes()


def test_evaluate_relations_prints_the_promised_json(cwlf: Call, tmp_path: Path) -> None:
    log = write_log(tmp_path / "drive.log", *(SCAN.format(x=0.1 * k, stamp=float(k)) for k in range(5)))
    cwlf("run", log, "--out", tmp_path / "run")
    relations = tmp_path / "drive.relations"
    relations.write_text("0.0 4.0 0.4 0 0 0 0 0\n1.0 2.0 0.2 0 0 0 0 0\n")
    report = json.loads(cwlf("evaluate", tmp_path / "run", "--relations", relations, "--json").out)["relations"]
    assert report["count"] == 2
    assert report["translation_mean_m"] == pytest.approx(0.05, abs=1e-6)
    assert report["translation_std_m"] == pytest.approx(0.05, abs=1e-6)
    assert report["rotation_mean_deg"] == pytest.approx(0.0, abs=1e-6)
    assert "rotation_std_deg" in report


@pytest.mark.slow
def test_demo_evaluates_itself(cwlf: Call, tmp_path: Path) -> None:
    outcome = cwlf("demo", "--out", tmp_path / "demo", "--seed", 2)
    assert outcome.code == 0
    metrics = json.loads((tmp_path / "demo" / "metrics.json").read_text())
    assert metrics["ate_rmse_m"] < 0.05
    assert metrics["landmark_rmse_m"] < 0.03
    assert "33 corners of the room" in outcome.out


def test_limit_counts_scans(cwlf: Call, room_log: Path, tmp_path: Path) -> None:
    cwlf("run", room_log, "--limit", 7, "--out", tmp_path / "run")
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["scans"] == 7


@pytest.mark.slow
def test_part_of_a_log_is_run_on_request(cwlf: Call, room_log: Path, tmp_path: Path) -> None:
    assert cwlf("run", room_log, "--limit", 5, "--every", 3, "--skip", 2.0, "--out", tmp_path / "run").code == 0
    stamps = np.loadtxt(tmp_path / "run" / "trajectory_online.tum")[:, 0]
    whole = np.loadtxt(tmp_path / "run" / "trajectory.tum")[:, 0]
    assert len(stamps) == 5
    np.testing.assert_allclose(np.diff(stamps), 0.3, atol=1e-6)
    assert len(whole) > 5 * len(stamps)
    outcome = cwlf("run", room_log, "--skip", 1e6, "--out", tmp_path / "none")
    assert outcome.code == 1
    assert "skip less" in outcome.err


def test_a_folder_that_is_not_empty_is_refused_until_told_otherwise(cwlf: Call, room_log: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    outcome = cwlf("run", room_log, "--limit", 1, "--out", tmp_path)
    assert outcome.code == 1
    assert "--overwrite" in outcome.err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
    assert cwlf("run", room_log, "--limit", 1, "--out", tmp_path, "--overwrite").code == 0
    assert (tmp_path / "mine.txt").read_text() == "precious"


def test_the_default_folder_is_named_after_log_and_date(
    cwlf: Call, room_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cwlf("run", room_log, "--limit", 1).code == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("room-2")


BAD_LOGS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "is empty"),
    "no scans": (b"ODOM 0 0 0 0 0 0 1.0 host 1.0\n", "no scan"),
    "wrong count": (b"FLASER 9 1 1 1 0 0 0 0 0 0 1.0 host 1.0\n" * 2, "line 1"),
    "nan": (b"FLASER 3 1 nan 1 0 0 0 0 0 0 1.0 host 1.0\n", "line 1: range of beam 1 is nan"),
    "negative": (b"FLASER 3 1 1 -1 0 0 0 0 0 0 1.0 host 1.0\n", "line 1: range of beam 2 is -1"),
    "binary": (bytes(range(256)) * 8, "binary"),
}


@pytest.mark.parametrize("kind", BAD_LOGS)
def test_a_bad_log_is_one_line_with_file_and_cause(
    kind: str, cwlf: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    content, cause = BAD_LOGS[kind]
    log = tmp_path / "bad.log"
    log.write_bytes(content)
    outcome = cwlf("run", log)
    assert outcome.code == 1
    assert len(outcome.err.splitlines()) == 1
    assert str(log) in outcome.err
    assert cause in outcome.err
    assert not list((tmp_path / "runs").glob("*")), "an empty run folder was left behind"


@pytest.mark.parametrize(("name", "cause"), [("missing.log", "no such file"), ("", "is a folder without")])
def test_a_log_that_is_none_is_one_line(name: str, cause: str, cwlf: Call, tmp_path: Path) -> None:
    outcome = cwlf("run", tmp_path / name)
    assert outcome.code == 1
    assert len(outcome.err.splitlines()) == 1
    assert cause in outcome.err


def test_what_came_before_a_broken_line_is_kept(cwlf: Call, tmp_path: Path) -> None:
    good = [SCAN.format(x=0.1 * k, stamp=float(k)) for k in range(3)]
    log = write_log(tmp_path / "half.log", *good, SCAN.format(x=1, stamp=3.0).replace(" 1.1", " nan"), good[2])
    out = tmp_path / "run"
    outcome = cwlf("run", log, "--out", out)
    assert outcome.code == 1
    assert "line 4" in outcome.err
    assert str(out) in outcome.err
    assert len(outcome.err.splitlines()) == 1
    assert {path.name for path in out.iterdir()} == FILES | {"checkpoint"}
    assert len(read_trajectory_file(out / "trajectory.tum")) == 3


@pytest.mark.slow
def test_a_truncated_last_line_costs_that_line_only(cwlf: Call, tmp_path: Path) -> None:
    good = [SCAN.format(x=0.1 * k, stamp=float(k)) for k in range(3)]
    log = tmp_path / "cut.log"
    log.write_text("\n".join([*good, SCAN.format(x=1, stamp=3.0)[:25]]))
    process = subprocess.run(
        [sys.executable, "-m", "slam.cli.main", "run", str(log), "--out", str(tmp_path / "run")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0
    assert "line 4" in process.stderr
    assert len(read_trajectory_file(tmp_path / "run" / "trajectory.tum")) == 3


def test_a_misspelt_key_and_an_unknown_sensor_are_named(cwlf: Call, room_log: Path, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("[front_end]\nmatch_probabilty = 0.9\n")
    outcome = cwlf("run", room_log, "--config", wrong)
    assert outcome.code == 1
    assert "front_end.match_probabilty" in outcome.err
    assert "rplidar-s1" in cwlf("run", room_log, "--sensor", "s9").err


def test_the_version_is_that_of_the_package(cwlf: Call) -> None:
    outcome = cwlf("--version")
    assert (outcome.code, outcome.out) == (0, f"cwlf-slam {version('cwlf-slam')}\n")


def test_bad_usage_is_exit_code_2(cwlf: Call, tmp_path: Path) -> None:
    assert cwlf("run").code == 2
    assert cwlf("evaluate", tmp_path).code == 2
    assert cwlf("demo", "--seed", "-1").code == 2
    assert cwlf("run", tmp_path / "any.log", "--resume").code == 2


def test_config_prints_toml_that_config_reads(cwlf: Call, tmp_path: Path) -> None:
    printed = cwlf("config", "--sensor", "rplidar-s1").out
    copy = tmp_path / "copy.toml"
    copy.write_text(printed)
    assert cwlf("config", "--config", copy).out == printed


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\nsys.argv = ['cwlf-slam', '--help']\nfrom slam.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print(sorted({'numpy', 'numba', 'scipy', 'gtsam', 'matplotlib', 'pydantic', 'filterpy'} & set(sys.modules)))"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.splitlines()[-1] == "[]"


@pytest.fixture
def interruptible() -> Iterator[None]:
    """Python's own handler of Ctrl-C, which a shell's background jobs begin without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_leaves_a_complete_folder_of_what_was_done(
    cwlf: Call, room_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = CarmenLog.__iter__

    def interrupted_frames(log: CarmenLog) -> Iterator[Frame]:
        for number, frame in enumerate(frames(log)):
            if number == 500:
                signal.raise_signal(signal.SIGINT)
            yield frame

    monkeypatch.setattr(CarmenLog, "__iter__", interrupted_frames)
    outcome = cwlf("run", room_log, "--sensor", "rplidar-s1", "--out", tmp_path / "run")
    assert outcome.code == 130
    assert "interrupted" in outcome.err
    assert {path.name for path in (tmp_path / "run").iterdir()} == FILES | {"checkpoint"}
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert metrics["interrupted"] is True
    assert 500 <= metrics["records"] <= 501
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_while_the_folder_is_written_leaves_it_complete(
    cwlf: Call, room_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw_map = slam.pictures.run_map.draw_map

    def interrupted_drawing(*arguments: Any) -> None:
        signal.raise_signal(signal.SIGINT)
        draw_map(*arguments)

    monkeypatch.setattr(slam.pictures.run_map, "draw_map", interrupted_drawing)
    assert cwlf("run", room_log, "--limit", 2, "--out", tmp_path / "run").code == 0
    assert {path.name for path in (tmp_path / "run").iterdir()} == FILES | {"checkpoint"}
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_output_that_cannot_be_written_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        process = subprocess.run(
            [sys.executable, "-m", "slam.cli.main", "config"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert process.returncode == 1
    assert process.stderr.splitlines() == ["cwlf-slam: [Errno 28] No space left on device"]


def test_a_bag_that_is_cut_short_is_run_as_far_as_it_goes(cwlf: Call, tmp_path: Path) -> None:
    """Two real scanners without odometry: one is chosen, the motion comes from its scans."""
    whole = DATA / "two-lidars.bag"
    if not whole.is_file():
        pytest.skip(f"{whole} is absent: set CWLF_DATA to the folder of the real logs")
    bag, out = tmp_path / "cut.bag", tmp_path / "run"
    bag.write_bytes(whole.read_bytes()[:600_000])
    outcome = cwlf("run", bag, "--out", out)
    assert outcome.code == 1
    assert "choose one with --scan-topic: it has /front_scan (sensor_msgs/LaserScan, " in outcome.err
    assert not out.exists()
    outcome = cwlf("run", bag, "--scan-topic", "/front_scan", "--out", out)
    assert outcome.code == 1
    assert [line for line in outcome.err.splitlines() if "scans/s" not in line] == [
        f"cwlf-slam: {bag} is cut short or damaged (Bag index looks damaged): expected an intact bag "
        f"(what came before is in {out})"
    ]
    assert {path.name for path in out.iterdir()} == FILES | {"checkpoint"}
    assert 50 < json.loads((out / "metrics.json").read_text())["scans"] < 150
    assert 'source = "lines"' in (out / "config.toml").read_text()
