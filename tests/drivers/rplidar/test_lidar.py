"""The driver on an emulated scanner, over a pseudo-terminal."""

import itertools
import logging
import os
import threading
import tty
from contextlib import contextmanager

import numpy as np
import pytest

from drivers.errors import DriverError
from drivers.rplidar import Command, RevolutionDecoder, Rplidar
from drivers.rplidar.device import Device
from drivers.rplidar.protocol.requests import motor_pwm, motor_speed, request
from features.se2 import wrap_angle

pytestmark = pytest.mark.slow

PATIENCE = 60.0
"""For what comes within seconds unless the machine is very busy [s]."""


def take(lidar):
    scan = lidar.take(PATIENCE)
    assert scan is not None
    return scan


class Tape:
    """Keeps the raw bytes of each scan."""

    def __init__(self):
        self.scans = []

    def begin(self, stream, time):
        self.scans.append((stream, []))

    def chunk(self, data, time):
        self.scans[-1][1].append((time, data))


@contextmanager
def answering(reply):
    """Port at whose other end each write is answered by what ``reply`` makes of it."""
    master, slave = os.openpty()
    tty.setraw(slave)
    ended = threading.Event()

    def answer():
        while not ended.is_set():
            try:
                os.write(master, reply(os.read(master, 4096)))
            except OSError:
                return

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    try:
        yield os.ttyname(slave)
    finally:
        ended.set()
        os.close(slave)
        os.close(master)


STOP = request(Command.STOP)


@pytest.mark.parametrize(
    ("model", "name", "sensor", "last"),
    [
        ("S1", "S1M1", "rplidar-s1", [STOP, motor_speed(0)]),
        ("A1", "A1M8", "rplidar-a1", [STOP]),
        ("A2", "A2M8", "rplidar-a2", [STOP, motor_pwm(0)]),
    ],
)
def test_revolutions_come_and_the_motor_stops(scanner, model, name, sensor, last):
    with scanner(model) as emulated:
        with Rplidar(emulated.port) as lidar:
            assert (lidar.name, lidar.sensor, lidar.device_info) == (name, sensor, emulated.device.model.info)
            frames = list(itertools.islice(lidar, 3))
        assert emulated.hears_last(*last)
    for frame in frames:
        assert frame.scan is not None
        assert frame.stamp == frame.scan.stamp
        assert (frame.pose_odom_robot == 0.0).all()
        # All sides of a closed room.
        assert np.histogram(frame.scan.angles[np.isfinite(frame.scan.ranges)], 8, (-np.pi, np.pi))[0].min() > 20
    assert lidar.counts.reconnects == 0
    assert lidar.counts.dropped_bytes == 0


def test_an_exception_stops_the_motor(scanner):
    def fail(port):
        with Rplidar(port) as lidar:
            take(lidar)
            raise ZeroDivisionError

    with scanner() as emulated:
        with pytest.raises(ZeroDivisionError):
            fail(emulated.port)
        assert emulated.hears_last(STOP, motor_speed(0))


@pytest.mark.parametrize(
    "faults",
    [
        ["stale-samples"],
        ["wrong-baud"],
        ["protection-stop", "silent-reset"],
        ["protection-stop", "banner", "stale-samples"],
    ],
    ids="+".join,
)
def test_a_scanner_in_a_bad_state_is_brought_to_scan(scanner, faults):
    with scanner("S1", faults) as emulated, Rplidar(emulated.port) as lidar:
        take(lidar)
        assert lidar.counts.dropped_bytes == 0


def test_a_scan_mode_is_chosen_by_its_name(scanner):
    with scanner() as emulated:
        with Rplidar(emulated.port, mode="standard") as lidar:
            # 4098 samples a second at 10 Hz, instead of 9259.
            assert len(take(lidar)) < 600
        with (
            pytest.raises(DriverError, match="has no scan mode 'fast': choose Standard, DenseBoost"),
            Rplidar(emulated.port, mode="fast"),
        ):
            pass


def test_the_next_program_finds_a_scanner_left_running(scanner):
    """As `kill -9` leaves it: the port is closed, and nothing is said to the scanner."""
    with scanner() as emulated:
        device = Device(emulated.port, threading.Event())
        device.start(device.typical)
        device._link.close()
        with Rplidar(emulated.port) as lidar:
            take(lidar)


def test_an_unplugged_scanner_is_found_again(scanner, caplog):
    caplog.set_level(logging.WARNING, "drivers.rplidar")
    with scanner() as emulated:
        lidar = Rplidar(emulated.port)
        with lidar:
            before = take(lidar)
            emulated.unplug()
            with scanner() as again:
                assert again.port == emulated.port
                scans = iter(lambda: take(lidar), None)
                after = next(scan for scan in scans if lidar.counts.reconnects)
                assert after.stamp > before.stamp
    assert lidar.counts.reconnects == 1
    lost, found = (record.getMessage() for record in caplog.records)
    assert "the connection broke off" in lost
    assert "check the cable; reconnecting" in lost
    assert "is connected again" in found


def test_closing_ends_the_search_for_an_unplugged_scanner(scanner):
    with scanner() as emulated:
        with Rplidar(emulated.port) as lidar:
            take(lidar)
            emulated.unplug()
            while take_now := lidar.take(0.2):
                assert len(take_now) > 0
        assert list(lidar.scans()) == []


def test_raw_bytes_replay_to_the_same_revolutions(scanner):
    tape = Tape()
    with scanner("S1", ["flipped-bytes", "split-reads"]) as emulated:
        with Rplidar(emulated.port, capacity=1000) as lidar:
            lidar.start(tape)
            scans = [take(lidar) for _ in range(5)]
        scans += list(lidar.scans())
    ((stream, chunks),) = tape.scans
    decoder = RevolutionDecoder(stream)
    replayed = [scan for time, data in chunks for scan in decoder.feed(data, time)]
    assert len(replayed) == len(scans) == lidar.counts.revolutions
    for scan, again in zip(scans, replayed, strict=True):
        assert scan.stamp == again.stamp
        np.testing.assert_array_equal(scan.ranges, again.ranges)
        np.testing.assert_array_equal(scan.angles, again.angles)
        np.testing.assert_array_equal(scan.times, again.times)


def test_what_the_tap_raises_reaches_who_takes_the_scans(scanner):
    class Full(Tape):
        def chunk(self, data, time):
            raise OSError("the disk is full")

    with scanner() as emulated, Rplidar(emulated.port) as lidar:
        lidar.start(Full())
        with pytest.raises(OSError, match="the disk is full"):
            take(lidar)
        assert emulated.hears_last(STOP, motor_speed(0))


def test_the_scan_shows_the_room_where_it_is(scanner):
    """A wall that is met ahead at a clockwise angle lies to the right: the corner distances of the room tell."""
    with scanner() as emulated:
        with Rplidar(emulated.port) as lidar:
            scan = take(lidar)
        scene = emulated.device._scene
        expected = scene.ranges(-scan.angles % (2.0 * np.pi), np.zeros(len(scan)), 40.0, np.random.default_rng(0))
    seen = (expected > 0.0) & np.isfinite(scan.ranges)
    # The noise of either is 20 mm; at the edges of things a beam may meet the other side.
    assert np.mean(np.abs(scan.ranges - expected)[seen] < 0.15) > 0.95
    assert (np.abs(wrap_angle(scan.angles) - scan.angles) < 1e-12).all()


def test_a_port_without_scanner_is_told():
    with answering(lambda data: b"") as port, pytest.raises(DriverError, match="no RPLIDAR answers at 115200 baud"):
        Rplidar(port, baud=115200).__enter__()


def test_an_echo_is_no_scanner():
    with answering(lambda data: data) as port, pytest.raises(DriverError, match="no RPLIDAR answers"):
        Rplidar(port, baud=115200).__enter__()


def test_a_ydlidar_is_named():
    packet = bytes.fromhex("aa55000105") + bytes(20)
    with answering(lambda data: packet * 10) as port, pytest.raises(DriverError, match="this is a YDLIDAR"):
        Rplidar(port, baud=115200).__enter__()


def test_a_port_that_is_not_there_is_told(tmp_path):
    with pytest.raises(DriverError, match="there is no such port: `cwlf-slam devices` lists"):
        Rplidar(str(tmp_path / "none")).__enter__()


def test_a_port_that_is_none_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(DriverError, match="cannot be opened as a serial port"):
        Rplidar(str(tmp_path / "file")).__enter__()


def test_a_port_in_use_is_told(scanner):
    with scanner() as emulated, Rplidar(emulated.port) as lidar:
        take(lidar)
        with pytest.raises(DriverError, match="another program uses the port"):
            Rplidar(emulated.port).__enter__()


def test_a_scanner_that_was_not_opened_knows_nothing():
    with pytest.raises(ValueError, match="use it in a `with` block"):
        _ = Rplidar("any").name
