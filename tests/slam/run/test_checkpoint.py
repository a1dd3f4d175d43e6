"""A run that was stopped, however it was stopped, goes on to the bytes of one that was not."""

import gzip
import itertools
import json
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from command_line import Call
from places import DATA

import slam.run.checkpoint
from drivers import CarmenLog, Frame
from features import LaserScan
from sim import room_run
from slam.config import SlamConfig
from slam.config_file import load_config
from slam.errors import RunFolderError
from slam.pipeline import Slam
from slam.result.trajectory_file import write_tum
from slam.run.checkpoint import CHECKPOINT, LogPosition, read_checkpoint, write_checkpoint
from slam.run.frame_digest import extend_digest

RECORDS = 1600


@cache
def room():
    source = room_run(4)
    config = load_config(None, source=source.info)
    return list(itertools.islice(source, RECORDS)), config


def written(slam: Slam, folder: Path) -> list[bytes]:
    result = slam.finish()
    folder.mkdir(exist_ok=True)
    for name in ("trajectory", "trajectory_online", "trajectory_odometry"):
        write_tum(folder / name, getattr(result, name))
    return [path.read_bytes() for path in sorted(folder.iterdir())] + [result.landmarks.to_csv().encode()]


def uninterrupted(frames: list[Frame], config: SlamConfig, folder: Path) -> list[bytes]:
    slam = Slam(config)
    for frame in frames:
        slam.process(frame)
    return written(slam, folder)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["line-aided", "lines", "wheel"])
def test_a_run_goes_on_to_the_same_bytes_wherever_it_stopped(source: str, tmp_path: Path) -> None:
    """Stopped before the first scan after it began, between two scans, and again and again; solved in between."""
    frames, config = room()
    config = config.model_copy(update={"odometry": config.odometry.model_copy(update={"source": source})})
    slam = Slam(config)
    for record, frame in enumerate(frames):
        if record in (1, 57, 800, 803, 1400):
            write_checkpoint(tmp_path, slam, LogPosition("room", record))
            if record == 800:
                slam.finish()
            slam, position = read_checkpoint(tmp_path)
            assert position == LogPosition("room", record)
            assert slam.config.model_dump() == config.model_dump()
        slam.process(frame)
    assert written(slam, tmp_path / "stopped") == uninterrupted(frames, config, tmp_path / "whole")


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="real logs are not here")
def test_a_real_log_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    log = CarmenLog(DATA / "intel-lab.clf.gz")
    frames = list(itertools.islice(log, 1800))
    config = SlamConfig.of_preset(log.sensor, log.mounting)
    slam = Slam(config)
    for record, frame in enumerate(frames):
        if record in (500, 1500):
            write_checkpoint(tmp_path, slam, LogPosition("intel", record))
            slam, _ = read_checkpoint(tmp_path)
        slam.process(frame)
    assert written(slam, tmp_path / "stopped") == uninterrupted(frames, config, tmp_path / "whole")


@pytest.mark.slow
def test_the_same_log_gives_the_same_bytes_twice(tmp_path: Path) -> None:
    frames, config = room()
    assert uninterrupted(frames, config, tmp_path / "a") == uninterrupted(frames, config, tmp_path / "b")


KERNELS = """
import hashlib, pickle, sys
import numpy as np
from features import extract
from slam.parts import line_odometry
frames, config = pickle.load(open(sys.argv[1], "rb"))
odometry = line_odometry(config, np.zeros(3))
digest = hashlib.sha256()
for frame in frames:
    odometry.predict(frame.stamp, frame.pose_odom_robot)
    if frame.scan is not None:
        features = extract(frame.scan, config.sensor.model(), config.extraction)
        odometry.register(frame.stamp, frame.scan, features.lines)
        odometry.add_key_frame()
        digest.update(features.lines.params.tobytes() + features.lines.covs.tobytes() + odometry.pose.tobytes())
        digest.update(features.corners.positions.tobytes() + features.corners.covs.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_a_process_that_compiles_finds_the_bytes_of_one_that_loads(tmp_path: Path) -> None:
    frames, config = room()
    # What is simulated comes along, so that the kernels of the simulator need not be compiled.
    (tmp_path / "frames").write_bytes(pickle.dumps((frames[:80], config)))
    command = [sys.executable, "-c", KERNELS, tmp_path / "frames"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    prints = [subprocess.run(command, env=environment, capture_output=True, text=True, check=True) for _ in range(2)]
    assert prints[0].stdout == prints[1].stdout


def test_what_is_not_ours_is_not_read(tmp_path: Path) -> None:
    class Foreign:
        def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
            return os.mkdir, (str(tmp_path / "made"),)

    write_checkpoint(tmp_path, Foreign(), LogPosition("room"))  # type: ignore[arg-type]
    with pytest.raises(RunFolderError, match="does not belong in a checkpoint"):
        read_checkpoint(tmp_path)
    assert not (tmp_path / "made").exists()


def test_frames_are_told_apart_by_every_value() -> None:
    scan = LaserScan(np.ones(3), np.arange(3.0), 1.0)
    frames = [
        Frame(1.0, np.zeros(3)),
        Frame(1.5, np.zeros(3)),
        Frame(1.0, np.array([0.0, 0.0, -0.0])),
        Frame(1.0, np.zeros(3), scan),
        Frame(1.0, np.zeros(3), LaserScan(np.ones(3), np.arange(3.0), 1.5)),
        Frame(1.0, np.zeros(3), LaserScan(np.ones(3), np.arange(3.0), 1.0, np.zeros(3))),
        Frame(1.0, np.zeros(3), LaserScan(2.0 * np.ones(3), np.arange(3.0), 1.0)),
    ]
    assert len({extend_digest(b"", frame) for frame in frames}) == len(frames)
    assert extend_digest(b"", frames[3]) == extend_digest(b"", Frame(1.0, np.zeros(3), scan))
    assert extend_digest(b"before", frames[3]) != extend_digest(b"", frames[3])


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    lines: list[str] = []
    for frame in room()[0][:1000]:
        x, y, theta = frame.pose_odom_robot
        tail = f"{frame.stamp:.6f} host {frame.stamp:.6f}"
        if frame.scan is None:
            lines.append(f"ODOM {x:.6f} {y:.6f} {theta:.6f} 0 0 0 {tail}")
            continue
        ranges = np.where(np.isfinite(frame.scan.ranges), frame.scan.ranges, 40.0)[::4]
        readings = " ".join(f"{value:.4f}" for value in ranges)
        step = 4.0 * (frame.scan.angles[1] - frame.scan.angles[0])
        pose = f"{x:.6f} {y:.6f} {theta:.6f}"
        lines.append(
            f"ROBOTLASER1 0 {frame.scan.angles[0]:.9f} {step * len(ranges):.9f} {step:.9f} 40 0.02 0 {len(ranges)} "
            f"{readings} 0 {pose} {pose} 0 0 0 0 0 {tail}"
        )
    path = tmp_path_factory.mktemp("logs") / "room.log.gz"
    path.write_bytes(gzip.compress("\n".join(lines).encode() + b"\n"))
    return path


@pytest.fixture
def cwlf(cwlf: Call) -> Callable[..., tuple[int, str]]:
    """Code and errors of a command, without its progress."""

    def call(*arguments: object) -> tuple[int, str]:
        code, _, err = cwlf(*arguments)
        return code, "\n".join(line for line in err.splitlines() if "scans/s" not in line)

    return call


def files(folder: Path) -> list[bytes]:
    """Everything that does not tell the time it took."""
    return [path.read_bytes() for path in sorted(folder.iterdir()) if path.suffix in {".tum", ".csv", ".toml"}]


@pytest.mark.slow
def test_the_command_goes_on_after_a_limit_to_the_same_files(
    cwlf: Callable[..., tuple[int, str]], log: Path, tmp_path: Path
) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    assert cwlf("run", log, "--sensor", "rplidar-s1", "--out", whole, "--seed", 3) == (0, "")
    assert not (whole / CHECKPOINT).exists()
    assert cwlf("run", log, "--sensor", "rplidar-s1", "--out", stopped, "--seed", 3, "--limit", 60) == (0, "")
    assert json.loads((stopped / "metrics.json").read_text())["scans"] == 60
    assert cwlf("run", log, "--out", stopped, "--resume", "--limit", 130) == (0, "")
    assert json.loads((stopped / "metrics.json").read_text())["scans"] == 130
    assert cwlf("run", log, "--out", stopped, "--resume") == (0, "")
    assert files(stopped) == files(whole)
    code, error = cwlf("run", log, "--out", stopped, "--resume")
    assert (code, len(error.splitlines())) == (1, 1)
    assert "complete" in error


KILLED = """
import os, signal, sys
import slam.run.session as session
session.LEAST_INTERVAL_S = session.LEAST_SHARE = 0.0
write, count = session.write_checkpoint, 0
def write_and_die(*arguments):
    global count
    write(*arguments)
    count += 1
    if count == 333:
        os.kill(os.getpid(), signal.SIGKILL)
session.write_checkpoint = write_and_die
from slam.cli.main import main
main()
"""


@pytest.mark.slow
def test_a_run_that_was_killed_goes_on_to_the_same_files(
    cwlf: Callable[..., tuple[int, str]], log: Path, tmp_path: Path
) -> None:
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    arguments = ("run", str(log), "--sensor", "rplidar-s1", "--limit", "100")
    assert cwlf(*arguments, "--out", whole)[0] == 0
    process = subprocess.run(
        [sys.executable, "-c", KILLED, *arguments, "--out", str(killed)], capture_output=True, check=False
    )
    assert process.returncode == -signal.SIGKILL
    assert {path.name for path in killed.iterdir()} == {CHECKPOINT}
    # One that died while it wrote leaves the checkpoint before it.
    (killed / f"{CHECKPOINT}.part").write_bytes(b"cut short")
    assert cwlf("run", log, "--out", killed, "--resume", "--limit", 100)[0] == 0
    assert files(killed) == files(whole)


@pytest.mark.slow
def test_a_log_that_broke_goes_on_once_it_is_whole(
    cwlf: Callable[..., tuple[int, str]], log: Path, tmp_path: Path
) -> None:
    lines = gzip.decompress(log.read_bytes()).splitlines(keepends=True)
    broken = tmp_path / "room.log"
    broken.write_bytes(b"".join(lines[:600]) + b"FLASER 2 nan nan 0 0 0 0 0 0 12.0 host 12.0\n" + b"".join(lines[600:]))
    whole, out = tmp_path / "whole", tmp_path / "broken"
    assert cwlf("run", log, "--sensor", "rplidar-s1", "--out", whole)[0] == 0
    code, error = cwlf("run", broken, "--sensor", "rplidar-s1", "--out", out)
    assert code == 1
    assert "line 601" in error
    broken.write_bytes(b"".join(lines))
    assert cwlf("run", broken, "--out", out, "--resume")[0] == 0
    assert files(out) == files(whole)


@pytest.fixture
def stopped(cwlf: Callable[..., tuple[int, str]], log: Path, tmp_path: Path) -> Path:
    out = tmp_path / "stopped"
    assert cwlf("run", log, "--sensor", "rplidar-s1", "--out", out, "--limit", 20)[0] == 0
    return out


def other_log(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    lines = gzip.decompress(log.read_bytes()).splitlines(keepends=True)
    (stopped.parent / "other.log").write_bytes(b"".join([lines[0], *lines[2:]]))
    return [stopped.parent / "other.log"]


def other_sensor(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    return [log, "--sensor", "sick-lms"]


def other_config(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    (stopped.parent / "other.toml").write_text('[sensor]\npreset = "rplidar-s1"\n[loop]\napart_m = 9.0\n')
    return [log, "--config", stopped.parent / "other.toml"]


def other_version(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    monkeypatch.setattr(slam.run.checkpoint, "fingerprint", lambda: "another")
    return [log]


def damaged(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    content = bytearray((stopped / CHECKPOINT).read_bytes())
    content[len(content) // 2] ^= 1
    (stopped / CHECKPOINT).write_bytes(content)
    return [log]


def cut_short(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    (stopped / CHECKPOINT).write_bytes((stopped / CHECKPOINT).read_bytes()[:100])
    return [log]


def no_checkpoint(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    for path in stopped.iterdir():
        path.unlink()
    return [log]


def no_folder(stopped: Path, log: Path, monkeypatch: pytest.MonkeyPatch) -> list[object]:
    stopped.rename(stopped.parent / "elsewhere")
    return [log]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (other_log, "does not begin with the same"),
        (other_sensor, "sensor.preset = 'rplidar-s1', not 'sick-lms'"),
        (other_config, "loop.apart_m = 15.0, not 9.0"),
        (other_version, "another version"),
        (damaged, "is damaged"),
        (cut_short, "is damaged"),
        (no_checkpoint, "holds no checkpoint"),
        (no_folder, "no such run folder"),
    ],
)
def test_what_cannot_go_on_is_one_line_and_changes_nothing(
    change: Callable[..., list[object]],
    cause: str,
    cwlf: Callable[..., tuple[int, str]],
    stopped: Path,
    log: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    arguments = change(stopped, log, monkeypatch)
    before = {path: path.read_bytes() for path in stopped.parent.rglob("*") if path.is_file()}
    code, error = cwlf("run", *arguments, "--out", stopped, "--resume")
    assert code == 1
    assert len(error.splitlines()) == 1
    assert cause in error
    assert {path: path.read_bytes() for path in stopped.parent.rglob("*") if path.is_file()} == before


def test_a_checkpoint_is_plain_pickle_behind_one_line(stopped: Path) -> None:
    header, _, state = (stopped / CHECKPOINT).read_bytes().partition(b"\n")
    assert json.loads(header)["log"] == "room"
    assert pickle.loads(state).scans == 20
