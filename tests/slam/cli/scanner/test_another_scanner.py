"""The module of docs/extending.md: one module and one registration give the commands another scanner."""

import json
import re

import numpy as np
import pytest
from places import ROOT

from drivers.recording.recording import Recording
from drivers.scanners import SCANNERS
from features.se2 import pose
from sim import Lidar, room

PAGE = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
SECTION = PAGE.split("## Another scanner", 1)[1].split("\n## ", 1)[0]
(MODULE,) = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)
SCANS = 12


@pytest.fixture(autouse=True)
def registered(tmp_path, monkeypatch):
    """Write the module, and add its line to the registry."""
    (tmp_path / "line_scanner.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(SCANNERS, "lines", "line_scanner")


@pytest.fixture
def port(tmp_path):
    """Port of a scanner that sends a few revolutions, standing in a room."""
    lidar, rng = Lidar.of_preset("rplidar-s1"), np.random.default_rng(1)
    scans = [lidar.scan(room(), pose(2.0, 2.0, 0.3), 0.1 * k, rng) for k in range(SCANS)]
    path = tmp_path / "port"
    path.write_text("".join(f"{s.stamp:.1f} {' '.join(f'{r:.4f}' for r in s.ranges)}\n" for s in scans))
    return path


def test_devices_lists_it(cwlf, port):
    outcome = cwlf("devices", "--scanner", "lines", "--port", port, "--port", "/nowhere")
    assert outcome == (0, f"line scanner on {port}\n/nowhere: there is no such port\n", "")


@pytest.mark.slow
def test_live_maps_with_it_and_keeps_its_bytes(cwlf, port, tmp_path):
    live, again = tmp_path / "live", tmp_path / "again"
    outcome = cwlf("live", "--scanner", "lines", "--port", port, "--out", live)
    assert outcome.code == 0, outcome.err
    assert json.loads((live / "metrics.json").read_text())["scans"] == SCANS
    assert cwlf("replay", live / "recording.jsonl.gz", "--speed", 0, "--out", again).code == 0
    assert (again / "trajectory.tum").read_bytes() == (live / "trajectory.tum").read_bytes()


def test_record_keeps_its_scans_and_bytes(cwlf, port, tmp_path):
    path = tmp_path / "hall.jsonl.gz"
    outcome = cwlf("record", "--scanner", "lines", "--port", port, "--out", path, "--limit", 5)
    assert outcome.code == 0, outcome.err
    assert outcome.out.startswith("5 scans, ")
    recording = Recording(path)
    assert (recording.name, len(list(recording))) == ("lines", 5)
    assert sum("bytes" in record for _, record in recording.lines()) == 5


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [
        (("--scanner", "lines", "--port", "/nowhere"), "/nowhere cannot be opened: No such file or directory"),
        (("--scanner", "lines", "--port", "p", "--rpm", "600"), "a line scanner has no options but --port"),
        (("--scanner", "radar"), "no scanner is called 'radar': choose lines, rplidar"),
    ],
)
@pytest.mark.parametrize("command", ["live", "record"])
def test_what_is_wrong_is_one_line(cwlf, tmp_path, command, arguments, cause):
    outcome = cwlf(command, *arguments, "--out", tmp_path / "out")
    assert (outcome.code, outcome.out, outcome.err.count("\n")) == (1, "", 1)
    assert outcome.err.startswith(f"cwlf-slam: {cause}")
    assert not (tmp_path / "out").exists()
