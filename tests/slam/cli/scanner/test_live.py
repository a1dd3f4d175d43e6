"""Live, record and replay as a user meets them, against an emulated scanner."""

import json
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from emulated import emulated_chunks, emulated_device

from drivers.frame import Frame, SourceInfo
from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording
from drivers.rplidar import RawRecorder, RevolutionDecoder
from sim.emulator.terminal import Terminal

pytestmark = pytest.mark.slow


@pytest.fixture
def port(tmp_path: Path) -> Iterator[Path]:
    """Port of an emulated S1 in a room, in real time."""
    link, done = tmp_path / "my scanner", threading.Event()
    with Terminal(emulated_device(), link) as terminal:
        thread = threading.Thread(target=terminal.serve, args=(done.is_set,))
        thread.start()
        yield link
        done.set()
        thread.join()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "hall.jsonl.gz"
    stream, chunks = emulated_chunks(seconds=4.0)
    with Recorder(path, SourceInfo("S1M1", "rplidar-s1", has_odometry=False)) as recorder:
        tap, decoder = RawRecorder(recorder), RevolutionDecoder(stream)
        tap.begin(stream, 0.0)
        for time, data in chunks:
            tap.chunk(data, time)
            for scan in decoder.feed(data, time):
                recorder.write(Frame(scan.stamp, np.zeros(3), scan))
    return path


@pytest.mark.slow
def test_replay_of_the_bytes_is_the_run_of_the_scans(cwlf, recording, tmp_path):
    replayed = cwlf("replay", recording, "--speed", 0, "--out", tmp_path / "replay")
    run = cwlf("run", recording, "--out", tmp_path / "run")
    assert (replayed.code, run.code) == (0, 0)
    assert "scans" in replayed.out
    for name in ("trajectory.tum", "trajectory_online.tum", "landmarks.csv"):
        assert (tmp_path / "replay" / name).read_bytes() == (tmp_path / "run" / name).read_bytes()
    assert 'source = "lines"' in (tmp_path / "run" / "config.toml").read_text()


def test_replay_of_what_is_no_recording_is_one_line(cwlf, tmp_path):
    (tmp_path / "log").write_text("FLASER 1 1\n")
    outcome = cwlf("replay", tmp_path / "log")
    assert outcome.code == 1
    assert outcome.err.startswith(f"cwlf-slam: {tmp_path / 'log'}, line 1: ")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize("command", ["live", "record"])
def test_port_that_is_not_there_is_one_line_and_leaves_nothing(cwlf, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    outcome = cwlf(command, "--port", tmp_path / "none", "--out", tmp_path / "out")
    assert outcome.code == 1
    assert outcome.err.count("\n") == 1
    assert "none: there is no such port" in outcome.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_recorded_scanner_runs(cwlf, port, tmp_path):
    path = tmp_path / "hall.jsonl.gz"
    outcome = cwlf("record", "--port", port, "--out", path, "--limit", 5)
    assert outcome.code == 0, outcome.err
    assert outcome.out.startswith("5 scans, ")
    assert len(list(Recording(path))) == 5
    assert cwlf("run", path, "--out", tmp_path / "run").code == 0
    assert cwlf("record", "--port", port, "--out", path).err.endswith("choose another name or give --overwrite\n")


@pytest.mark.slow
def test_live_run_leaves_a_run_folder_and_a_recording_that_runs_to_the_same(cwlf, port, tmp_path):
    outcome = cwlf("live", "--port", port, "--out", tmp_path / "live", "--limit", 8)
    assert outcome.code == 0, outcome.err
    assert json.loads((tmp_path / "live" / "metrics.json").read_text())["scans"] == 8
    again = cwlf("run", tmp_path / "live" / "recording.jsonl.gz", "--out", tmp_path / "again", "--limit", 8)
    assert again.code == 0, again.err
    assert (tmp_path / "again" / "trajectory.tum").read_bytes() == (tmp_path / "live" / "trajectory.tum").read_bytes()


def test_wheels_join_a_live_run(cwlf, port, tmp_path):
    wheels = tmp_path / "wheels"
    wheels.write_text("0 1 2 0.5\n9e9 1 2 0.5\n")
    outcome = cwlf("live", "--port", port, "--odometry", wheels, "--out", tmp_path / "live", "--limit", 3)
    assert outcome.code == 0, outcome.err
    assert 'source = "line-aided"' in (tmp_path / "live" / "config.toml").read_text()
    frames = list(Recording(tmp_path / "live" / "recording.jsonl.gz"))
    assert frames[0].pose_odom_robot == pytest.approx([1.0, 2.0, 0.5])
