"""Once the modules are imported nothing is compiled any more, whatever comes: a robot drives meanwhile."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from emulated import emulated_chunks

from drivers.frame import Frame, SourceInfo
from drivers.recording.recorder import Recorder
from drivers.rplidar import RawRecorder, RevolutionDecoder
from features.extraction import extract
from features.scan import LaserScan
from features.sensor import sensor_preset
from sim import room_run

COMMANDS = """
import sys
import numpy as np
from numba.core.event import RecordingListener, install_listener
from drivers.frame import Frame, LandmarkObservations
from slam.cli.main import main
from slam.config_file import load_config
from slam.pipeline import Slam
import sim, slam.pictures.live_view, slam.study.paper.timing

def past_landmarks():
    # Another program has found them and cannot tell them apart.
    slam, landmarks = Slam(load_config(None)), np.array([[3.0, 1.0], [3.0, -1.0], [6.0, 2.0]])
    for k in range(20):
        x, y = (landmarks - [0.2 * k, 0.0]).T
        seen = LandmarkObservations(np.hypot(x, y), np.arctan2(y, x))
        slam.process(Frame(0.1 * k, np.array([0.2 * k, 0.0, 0.0]), observations=seen))
    assert len(slam.finish().landmarks.positions) == 3

with install_listener("numba:compile", listener := RecordingListener()):
    past_landmarks()
    for line in sys.argv[1].splitlines():
        sys.argv = ["cwlf-slam", *line.split()]
        try:
            main()
        except SystemExit as left:
            assert not left.code, line
print(f"compiled: {[event.data['dispatcher'] for _, event in listener.buffer]}")
"""


def record(path: Path, frames: list[Frame]) -> None:
    with Recorder(path, SourceInfo("drive", "rplidar-s1")) as recorder:
        for frame in frames:
            recorder.write(frame)


def scans() -> list[Frame]:
    """A drive through the room, in which scans show everything, nothing, and a single wall."""
    sensor, angles = sensor_preset("rplidar-s1"), np.linspace(-0.6, 0.6, 60)
    wall = LaserScan(2.0 / np.cos(angles), angles)
    empty = LaserScan(np.full(60, np.inf), angles), LaserScan(np.empty(0), np.empty(0))
    assert len(extract(wall, sensor).lines) == 1
    frames: list[Frame] = []
    for frame in room_run(1):
        if frame.scan is not None and (index := len(frames)) >= 10 and index % 5 < 3:
            scan = (wall, *empty)[index % 5]
            frame = Frame(frame.stamp, frame.pose_odom_robot, scan)  # noqa: PLW2901
        frames.append(frame)
        if len(frames) == 150:
            break
    return frames


@pytest.mark.slow
def test_commands_compile_nothing(tmp_path: Path) -> None:
    record(tmp_path / "scans.jsonl.gz", scans())
    stream, chunks = emulated_chunks(seconds=2.0)
    with Recorder(tmp_path / "raw.jsonl.gz", SourceInfo("S1", "rplidar-s1", has_odometry=False)) as to:
        tap, decoder = RawRecorder(to), RevolutionDecoder(stream)
        tap.begin(stream, 0.0)
        for time, data in chunks:
            tap.chunk(data, time)
            for scan in decoder.feed(data, time):
                to.write(Frame(scan.stamp, np.zeros(3), scan))
    commands = (
        f"demo --out {tmp_path}/demo",
        f"run {tmp_path}/scans.jsonl.gz --out {tmp_path}/run",
        f"replay {tmp_path}/raw.jsonl.gz --speed 0 --out {tmp_path}/replay",
        f"study timing --repeats 1 --out {tmp_path}/timing",
    )
    command = [sys.executable, "-c", COMMANDS, "\n".join(commands)]
    outcome = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert outcome.returncode == 0, outcome.stderr
    assert outcome.stdout.splitlines()[-1] == "compiled: []"
