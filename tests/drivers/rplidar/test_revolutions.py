"""Revolutions out of bytes with times, against the exact books of the emulator."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drivers.rplidar import Answer, AnswerSearch, RevolutionDecoder, ScanStream, encode_dense, encode_standard
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.protocol.requests import Command, express_scan, motor_pwm, request
from sim.emulator import MODELS

SECONDS = 10.0
"""Of data; 80 revolutions and more after the spin-up."""


def emulated(device, number):
    """Bytes of a scan with their times, cut as they came."""
    mode = device.model.modes[number]
    device.write(request(Command.SCAN) if mode.answer is Answer.STANDARD else express_scan(number), 0.0)
    search, pieces = AnswerSearch({mode.answer: FORMATS[mode.answer].size}, multiple=True), []
    for time, data in device.chunks(SECONDS):
        if search.descriptor is None:
            search.feed(data)
            pieces.append((time, search.rest))
        else:
            pieces.append((time, data))
    return ScanStream(mode.answer, mode.us_per_sample, device.baud), pieces


def decode(stream, pieces):
    decoder = RevolutionDecoder(stream)
    return decoder, [scan for time, data in pieces for scan in decoder.feed(data, time)]


def check_books(device, decoder, scans):
    """What arrived whole by the books is whole here, and nothing else."""
    device.end(SECONDS)
    counts, ledger = decoder.counts, device.ledger
    assert len(scans) == counts.revolutions
    assert counts.packets == ledger.packets
    assert counts.revolutions - counts.patchy_revolutions == ledger.revolutions
    assert counts.dropped_revolutions == 0


MODES = {mode.answer.name: (model.name, number) for model in MODELS.values() for number, mode in enumerate(model.modes)}
"""A mode of some model for each type of packet."""


@pytest.mark.slow
@pytest.mark.parametrize(("model", "number"), MODES.values(), ids=MODES)
def test_no_revolution_is_lost_without_faults(device, model, number):
    scanner = device(model)
    scanner.write(motor_pwm(660), 0.0)
    stream, pieces = emulated(scanner, number)
    decoder, scans = decode(stream, pieces)
    counts = decoder.counts
    assert (counts.dropped_bytes, counts.discontinuities, counts.broken_revolutions, counts.patchy_revolutions) == (
        0,
    ) * 4
    assert abs(len(scans) - scanner.ledger.revolutions) <= 1
    assert len(scans) > 60
    spacing = 2.0 * np.pi / (0.1 / (stream.us_per_sample * 1e-6))
    for scan in scans:
        assert (np.diff(scan.angles) >= 0.0).all()
        assert scan.times.max() == 0.0
        assert -0.12 < scan.times.min() < -0.08
        assert abs(len(scan) * spacing - 2.0 * np.pi) < 0.05 * 2.0 * np.pi
    assert_allclose(np.diff([scan.stamp for scan in scans]), 0.1, atol=0.01)


FAULTS = ["flipped-bytes", "lost-bytes", "split-reads", "encoder-reset", "speed-change", "zero-sectors", "stall"]


@pytest.mark.slow
@pytest.mark.parametrize("faults", [*((fault,) for fault in FAULTS), FAULTS], ids=[*FAULTS, "all"])
def test_a_fault_costs_what_it_destroyed(device, faults):
    scanner = device("S1", faults)
    decoder, scans = decode(*emulated(scanner, 1))
    check_books(scanner, decoder, scans)
    assert (np.diff([scan.stamp for scan in scans]) > 0.0).all()
    for scan in scans:
        assert np.isfinite(scan.ranges).any()


@pytest.mark.slow
def test_of_nodes_a_fault_costs_a_few_more(device):
    """They have no checksum: where bytes are lost, those beside them may fit either way."""
    scanner = device("S1", FAULTS)
    decoder, scans = decode(*emulated(scanner, 0))
    scanner.end(SECONDS)
    events = sum(loss.events for name, loss in scanner.ledger.losses.items() if "bytes" in name)
    lost = scanner.ledger.packets - decoder.counts.packets - FORMATS[Answer.STANDARD].pending
    assert -9 <= lost <= 4 * events
    assert abs(len(scans) - scanner.ledger.revolutions) <= 2 * sum(
        loss.events + loss.revolutions for loss in scanner.ledger.losses.values()
    )
    assert (np.diff([scan.stamp for scan in scans]) > 0.0).all()


def test_angles_are_turned_counter_clockwise_with_their_ranges_and_times():
    """A range that tells its clockwise angle: 1 m and 1 cm per degree. Three turns of 900 samples from 10 deg on."""
    angles = np.radians(10.0 + 0.4 * np.arange(2800)).reshape(-1, 40)
    ranges = np.round(1.0 + np.degrees(angles) % 360.0 / 100.0, 3)
    stream, period = ScanStream(Answer.DENSE, 100.0, 256000), 1e-4
    capsules = [encode_dense(row[0] % (2.0 * np.pi), r) for row, r in zip(angles, ranges, strict=True)]
    pieces = [(50.0 + (k + 1) * 40 * period, capsule) for k, capsule in enumerate(capsules)]
    _, scans = decode(stream, pieces)
    assert len(scans) == 2
    for scan in scans:
        clockwise = -scan.angles % (2.0 * np.pi)
        assert_allclose(scan.ranges, 1.0 + np.degrees(clockwise) / 100.0, atol=1e-3)
        assert (np.diff(scan.angles) > 0.0).all()
        # Later is further clockwise: 0.4 deg in 100 us.
        assert_allclose(scan.times - scan.times.min(), clockwise / np.radians(0.4) * period, atol=1.5 * period)


def test_no_return_is_infinite():
    angles = np.arange(0, 2000) * np.radians(0.4)
    content = encode_standard(angles, np.zeros(2000), np.zeros(2000), np.arange(2000) % 900 == 0)
    _, scans = decode(ScanStream(Answer.STANDARD, 244.0, 256000), [(1.0, content)])
    assert len(scans) == 2
    assert all(np.isinf(scan.ranges).all() for scan in scans)


def test_what_lacks_a_turn_or_holds_a_part_of_one_is_no_revolution():
    """Turns of 100 nodes; one begin is not flagged, and one flag is false."""
    starts = np.arange(1000) % 100 == 0
    starts[300], starts[630] = False, True
    content = encode_standard(np.arange(1000) * np.radians(3.6), np.ones(1000), np.zeros(1000), starts)
    stream = ScanStream(Answer.STANDARD, 1000.0, 115200)
    decoder, scans = decode(stream, [(k / 200.0, content[5 * k * 5 : 5 * (k + 1) * 5]) for k in range(200)])
    assert {len(scan) for scan in scans} == {100, 70}
    assert decoder.counts.broken_revolutions == 2


@given(st.binary(max_size=2000), st.sampled_from(list(FORMATS)))
def test_any_bytes_may_come(noise, answer):
    decoder, scans = decode(
        ScanStream(answer, 100.0, 256000), [(k / 10.0, noise[k : k + 7]) for k in range(0, len(noise), 7)]
    )
    assert len(scans) == decoder.counts.revolutions
