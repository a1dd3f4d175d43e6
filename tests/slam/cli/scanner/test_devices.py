"""``cwlf-slam devices`` at an emulated scanner, and without one."""

import sys
import threading

import numpy as np
import pytest
from serial.tools import list_ports

from sim.emulator import MODELS, Device, Scene
from sim.emulator.terminal import Terminal
from sim.motion.true_trajectory import TrueTrajectory
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from slam.cli.main import main


@pytest.fixture
def devices(monkeypatch, capfd):
    """Run the command; return exit code, output and error output."""

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["cwlf-slam", "devices", *map(str, arguments)])
        with pytest.raises(SystemExit) as leaving:
            main()
        captured = capfd.readouterr()
        return int(leaving.value.code or 0), captured.out, captured.err

    return call


@pytest.fixture
def scanner(tmp_path):
    """Port of an emulated S1."""
    standing = TrueTrajectory(1.0, np.array([[2.0, 2.0, 0.0]]))
    device = Device(MODELS["S1"], Scene(room(), Lidar.of_preset("rplidar-s1"), standing))
    plugged, ended = threading.Event(), threading.Event()
    terminal = Terminal(device, tmp_path / "scanner", lambda path: plugged.set())

    def serve():
        with terminal:
            terminal.serve(ended.is_set)

    thread = threading.Thread(target=serve)
    thread.start()
    assert plugged.wait(30.0)
    yield tmp_path / "scanner"
    ended.set()
    thread.join(30.0)


def test_a_scanner_says_who_it_is(devices, scanner):
    code, out, _ = devices("--port", scanner, "--port", "/nowhere")
    head, standard, dense, other = out.splitlines()
    assert code == 0
    serial = MODELS["S1"].info.serial
    assert head == f"S1M1 on {scanner}: serial number {serial}, firmware 1.28, hardware 18, 256000 baud"
    assert standard == "    Standard: 4,098 samples/s, up to 40 m"
    assert dense == "    DenseBoost: 9,259 samples/s, up to 40 m (typical)"
    assert other.startswith("/nowhere: there is no such port")


def test_without_a_port_one_line_says_so(devices, monkeypatch):
    monkeypatch.setattr(list_ports, "comports", list)
    code, out, err = devices()
    assert (code, out) == (1, "")
    assert err.startswith("cwlf-slam: no USB serial port is there: plug the scanner in")
    assert err.count("\n") == 1


def test_one_port_without_a_scanner_is_one_line(devices):
    code, out, err = devices("--port", "/nowhere")
    assert (code, out) == (1, "")
    assert err == "cwlf-slam: /nowhere: there is no such port: `cwlf-slam devices` lists those that are there\n"


def test_ports_without_a_scanner_say_why(devices):
    code, out, err = devices("--port", "/nowhere", "--port", "/no/where")
    assert code == 1
    assert [line.split(":")[0] for line in out.splitlines()] == ["/nowhere", "/no/where"]
    assert err == "cwlf-slam: no scanner was found: each line above says why\n"
