"""An emulated scanner at the end of a pseudo-terminal, as a program with a serial port meets it."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import serial
from emulator_line import make

from drivers.rplidar import Answer, Command, SampleDecoder
from drivers.rplidar.protocol.requests import express_scan, request
from sim.emulator import Device
from sim.emulator.terminal import EmulatorError, Terminal

HEALTH = bytes.fromhex("a55a0300000006000000")


@contextmanager
def plugged(device: Device, link: Path, start: float = 0.0) -> Iterator[list[str]]:
    """Serve a device in a thread; what is yielded are the paths that were told."""
    ended, told = threading.Event(), []
    with Terminal(device, link, told.append, start) as terminal:
        thread = threading.Thread(target=terminal.serve, args=(ended.is_set,))
        thread.start()
        try:
            yield told
        finally:
            ended.set()
            thread.join()


def opened(link: Path, baud: int = 256000) -> serial.Serial:
    return serial.Serial(str(link), baud, timeout=10.0)


def test_a_program_asks_scans_leaves_and_comes_again(tmp_path: Path) -> None:
    link = tmp_path / "lidar"
    with plugged(make(), link):
        with opened(link) as port:
            port.write(request(Command.GET_HEALTH))
            assert port.read(10) == HEALTH
            port.write(express_scan(1))
            assert port.read(7) == bytes.fromhex("a55a5400004085")
            decoder = SampleDecoder(Answer.DENSE)
            assert sum(map(len, decoder.feed(port.read(84 * 50)))) == 40 * 49
            assert decoder.counts.dropped_bytes == 0
        with opened(link) as port:
            port.write(request(Command.STOP) + request(Command.GET_HEALTH))
            received = b""
            while not received.endswith(HEALTH):
                received += port.read(1)
    assert not link.is_symlink()


def test_at_another_rate_nobody_understands(tmp_path: Path) -> None:
    link = tmp_path / "lidar"
    with plugged(make(), link), opened(link, 115200) as port:
        port.write(request(Command.GET_HEALTH))
        port.timeout = 0.05
        assert port.read(10) == b""
        port.baudrate = 256000
        port.timeout = 10.0
        port.write(request(Command.GET_HEALTH))
        assert port.read(10) == HEALTH


def read_on(port: serial.Serial) -> None:
    while True:
        port.read(1000)


def test_a_pulled_cable_ends_the_connection_and_the_link_comes_back(tmp_path: Path) -> None:
    """A cable that should have been pulled long ago is pulled as soon as there is a scan."""
    link, device = tmp_path / "lidar", make(faults=("unplug",))
    with plugged(device, link, start=100.0) as told:
        with opened(link) as port:
            port.write(express_scan(1))
            with pytest.raises(serial.SerialException):
                read_on(port)
        while len(told) < 2:
            threading.Event().wait(0.01)
        with opened(link) as port:
            port.write(request(Command.GET_HEALTH))
            assert port.read(10) == HEALTH
    assert device.ledger.losses["unplug"].events == 1


def test_a_link_is_replaced_and_anything_else_is_not(tmp_path: Path) -> None:
    link = tmp_path / "lidar"
    link.symlink_to(tmp_path / "gone")
    with Terminal(make(), link):
        assert os.readlink(link).startswith("/dev/")
    assert not link.is_symlink()
    link.write_text("precious")
    with (
        pytest.raises(EmulatorError, match="no link can be made here: there is something else"),
        Terminal(make(), link),
    ):
        pass
    assert link.read_text() == "precious"
    with pytest.raises(EmulatorError, match="No such file"), Terminal(make(), tmp_path / "nowhere" / "lidar"):
        pass


def test_what_nobody_listens_to_is_gone() -> None:
    """Five seconds are over before the terminal is there, of which more than three are samples."""
    device = make()
    device.write(express_scan(1), 0.0)
    turns = iter(range(2))
    with Terminal(device, start=5.0) as terminal:
        terminal.serve(lambda: next(turns, None) is None)
    assert device.ledger.losses["nobody"].bytes > 60000
