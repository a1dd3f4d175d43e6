"""The command ``emulate`` as a user meets it."""

import signal
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import serial
from command_line import Call

from drivers.rplidar import Command
from drivers.rplidar.protocol.requests import express_scan, request
from sim.emulator.terminal import Terminal
from slam.cli.scanner.emulate import _laps


def test_ctrl_c_ends_it_with_the_books_and_the_truth(
    cwlf: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link, truth = tmp_path / "lidar", tmp_path / "truth.tum"
    serve = Terminal.serve

    def visit() -> None:
        with serial.Serial(str(link), 256000, timeout=10.0) as port:
            port.write(express_scan(1))
            assert len(port.read(7 + 84 * 100)) == 7 + 84 * 100
            port.write(request(Command.STOP))
        signal.raise_signal(signal.SIGINT)

    def served(terminal: Terminal, stopped: Callable[[], bool]) -> None:
        visitor = threading.Thread(target=visit)
        visitor.start()
        serve(terminal, stopped)
        visitor.join()

    monkeypatch.setattr(Terminal, "serve", served)
    code, out, err = cwlf(
        *("emulate", "--model", "s1", "--world", "room", "--link", link, "--truth", truth, "--fault", "split-reads")
    )
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == f"device: {link} (S1 at 256000 baud)"
    assert int(lines[1].removeprefix("sent").split()[0]) >= 100
    assert lines[2].split() == ["lost", "to", "events", "bytes", "packets", "debris", "samples", "revolutions"]
    assert {line.split()[0] for line in lines[3:-1]} == {"split-reads", "stop"}
    assert lines[-1] == f"truth: {truth}"
    assert not link.is_symlink()
    poses = np.loadtxt(truth)
    np.testing.assert_allclose(np.diff(poses[:, 0]), 0.02, atol=2e-6)
    np.testing.assert_allclose(poses[0, 1:3], (2.2, 1.7))


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [
        (("--world", "palace"), "no world and no file 'palace'"),
        (("--world", "room", "--fault", "gremlins"), "unknown fault 'gremlins': known are flipped-bytes"),
        (("--world", "room", "--path", "nowhere.csv"), "nowhere.csv: cannot be read"),
        (("--world", "room", "--link", "."), ".: no link can be made here"),
    ],
)
def test_what_is_wrong_is_one_line(cwlf: Call, arguments: tuple[str, ...], cause: str) -> None:
    code, out, err = cwlf("emulate", *arguments)
    assert (code, out, len(err.splitlines())) == (1, "", 1)
    assert cause in err


def test_bad_usage_is_told(cwlf: Call) -> None:
    assert cwlf("emulate", "--world", "room", "--model", "S9")[0] == 2
    assert cwlf("emulate")[0] == 2


def test_laps_go_there_and_back() -> None:
    path = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    np.testing.assert_array_equal(_laps(path, 1)[:, 0], [0, 1, 2])
    np.testing.assert_array_equal(_laps(path, 3)[:, 0], [0, 1, 2, 1, 0, 1, 2])
