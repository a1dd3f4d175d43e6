"""What an emulated scanner sends of the world: the right ranges at the right angles and times, the same every time."""

from dataclasses import replace

import numpy as np
import pytest
from emulator_line import BARE_ROOM, HEALED, NOISY, QUIET, TRAJECTORY, angles_of, listen, make, ranges_of

from drivers.rplidar import FORMATS, Answer, Command
from drivers.rplidar.protocol.requests import express_scan, motor_speed, request
from features.se2 import TWO_PI
from sim.emulator import MODELS, Device, Mode, Model

HQ = replace(MODELS["S2"], name="HQ", modes=(Mode("HQ", Answer.HQ, 62.5, 30.0),), typical=0)
MODES = [(model, mode) for model in (*MODELS.values(), HQ) for mode in range(len(model.modes))]

STEPS = {
    Answer.STANDARD: 0.25e-3,
    Answer.EXPRESS: 1e-3,
    Answer.ULTRA: 8e-3,
    Answer.DENSE: 1e-3,
    Answer.ULTRA_DENSE: 3e-3,
    Answer.HQ: 0.25e-3,
}
"""Largest step of a range within the room, which is less than 8.6 m across [m]."""


@pytest.mark.parametrize(("model", "mode"), MODES, ids=[f"{m.name}-{m.modes[k].name}" for m, k in MODES])
def test_samples_are_what_the_world_shows_where_and_when_they_were_taken(model: Model, mode: int) -> None:
    """Angles may err by half a 64th of a degree, by a bend of the angle within a packet and, where the receiver works
    out an optical offset, by two of its steps of 0.056 deg: 0.05 deg, and 0.15 deg, hold all of it. A corner
    within that reaches 20 mm beyond both of its sides."""
    heard = listen(Device(model, QUIET), mode, HEALED + 4.0)
    answer, period = model.modes[mode].answer, model.modes[mode].us_per_sample * 1e-6
    first = heard.data[1]
    in_first = len(first) // FORMATS[answer].size * FORMATS[answer].samples
    begin = heard.arrivals[1] - len(first) * 10.0 / model.baud - (in_first + 0.5) * period
    times = period * np.arange(heard.total)
    poses = TRAJECTORY.at(times)
    assert begin > HEALED, "the first sample waits for the rotation"
    assert np.ptp(poses[:, 2]) > 0.5, "the robot turns within the test"
    slack = np.radians(0.15 if answer is Answer.ULTRA else 0.05)
    sides = [BARE_ROOM.cast_beams(poses, -angles_of(heard.samples) + side)[0] for side in (-slack, slack)]
    ranges = ranges_of(heard.samples)
    assert (ranges > 0.0).all()
    assert (ranges >= np.minimum(*sides) - STEPS[answer]).all()
    assert (ranges <= np.maximum(*sides) + STEPS[answer] + 0.02).all()


def test_dense_packets_come_as_fast_as_an_s1_sends_them() -> None:
    """40 samples in 4320 us."""
    heard = listen(make(), 1, HEALED + 3.0)
    np.testing.assert_allclose(np.diff(heard.arrivals[1:]), 4320e-6, atol=1e-12)
    assert all(len(data) == 84 for data in heard.data[1:])


def test_only_the_first_capsule_says_that_the_angle_begins_anew() -> None:
    heard = listen(make(), 1, HEALED + 3.0)
    assert [bool(data[3] & 0x80) for data in heard.data[1:]] == [True] + [False] * (len(heard.data) - 2)


@pytest.mark.parametrize("rpm", [300, 600, 900])
def test_the_head_turns_at_the_speed_asked_for_with_jitter(rpm: int) -> None:
    device = make()
    device.write(motor_speed(rpm), 0.0)
    device.write(express_scan(1), 0.01)
    starts = [int.from_bytes(data[2:4], "little") & 0x7FFF for _, data in device.chunks(10.0) if len(data) == 84]
    steps = np.diff(starts[500:]) / 64.0 % 360.0
    wanted = rpm * 6.0 * 4320e-6
    assert steps.mean() == pytest.approx(wanted, rel=0.001)
    assert 0.001 < steps.std() / wanted < 0.01


def stream(**arguments: object) -> list[tuple[float, bytes]]:
    device = make(**arguments)  # type: ignore[arg-type]
    device.write(express_scan(1), 0.0)
    return list(device.chunks(4.0))


def test_a_stream_is_a_function_of_its_arguments() -> None:
    assert stream(scene=NOISY) == stream(scene=NOISY) != stream(scene=NOISY, seed=2)
    assert stream(scene=NOISY, faults=("flipped-bytes",)) != stream(scene=NOISY)


def test_it_does_not_matter_when_the_bytes_are_read() -> None:
    device, rng = make(scene=NOISY), np.random.default_rng(0)
    device.write(express_scan(1), 0.0)
    times = np.append(np.cumsum(rng.exponential(0.02, 100)), 4.0)
    assert b"".join(map(device.read, times)) == b"".join(data for _, data in stream(scene=NOISY))


def test_faults_of_the_line_leave_the_samples_as_they_are() -> None:
    plain = b"".join(data for _, data in stream(scene=NOISY))
    flipped = b"".join(data for _, data in stream(scene=NOISY, faults=("flipped-bytes",)))
    differing = sum(a != b for a, b in zip(plain, flipped, strict=True))
    assert 1 <= differing <= 4


def test_noise_is_that_of_the_preset() -> None:
    """Of 30,000 differences to the quiet ranges the deviation is known to 0.5 %; bearings add to it at the corners."""
    quiet, noisy = (listen(make(scene=scene), 1, HEALED + 5.0) for scene in (QUIET, NOISY))
    differences = ranges_of(noisy.samples) - ranges_of(quiet.samples)
    spread = np.median(abs(differences)) / 0.6745
    assert 0.02 < spread < 0.024
    assert abs(np.median(differences)) < 1e-3


def test_the_robot_leaves_with_the_first_sample_and_the_angle_grows_clockwise() -> None:
    device = make()
    device.write(request(Command.SCAN), 1.0)
    chunks = list(device.chunks(4.0))
    assert chunks[0] == (pytest.approx(1.001 + 7 * 10 / 256000), bytes.fromhex("a55a0500004081"))
    assert device.departure is not None
    assert device.departure > 1.5
    nodes = np.frombuffer(b"".join(data for _, data in chunks[1:]), np.uint8).reshape(-1, 5)
    angles = np.radians((nodes[:, 1].astype(int) + 256 * nodes[:, 2].astype(int) >> 1) / 64.0)
    steps = np.diff(angles) % TWO_PI
    assert ((steps > 0.01) & (steps < 0.02)).all(), "0.0153 rad in 244 us at 10 Hz"
