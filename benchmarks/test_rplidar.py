"""Decoding of half a second's worth of a fast link: samples per second, and beside it a scan of an S1 as it comes live.

A node and a capsule are decoded one by one in plain Python as the measure.
"""

import numpy as np
import pytest

from drivers.rplidar import Answer, SampleDecoder, encode_dense, encode_standard

SAMPLES = 1_000_000
TURN = 926
"""Samples of an S1 in a revolution at 10 Hz."""


def standard(count):
    rng = np.random.default_rng(0)
    angles = np.arange(count) * 2.0 * np.pi / TURN
    starts = np.arange(count) % TURN == 0
    return encode_standard(angles, rng.uniform(0.1, 16.0, count), np.full(count, 188), starts)


def dense(count):
    rng = np.random.default_rng(0)
    starts = np.arange(0, count, 40) * 2.0 * np.pi / TURN
    return b"".join(encode_dense(start, rng.uniform(0.1, 40.0, 40)) for start in starts)


def decode(answer, data, chunk):
    decoder = SampleDecoder(answer)
    return sum(len(batch) for at in range(0, len(data), chunk) for batch in decoder.feed(data[at : at + chunk]))


def nodes_one_by_one(data):
    samples = []
    for at in range(0, len(data) - 4, 5):
        head, low, high = data[at], data[at + 1], data[at + 2]
        distance = data[at + 3] | data[at + 4] << 8
        samples.append(((low >> 1 | high << 7) / 64.0, distance / 4.0, head >> 2, head & 1))
    return len(samples)


def capsules_one_by_one(data):
    samples = []
    for at in range(0, len(data) - 167, 84):
        start, end = ((data[k + 2] | data[k + 3] << 8) & 0x7FFF for k in (at, at + 84))
        checksum = 0
        for byte in data[at + 2 : at + 84]:
            checksum ^= byte
        step = (end - start) % 23040 / 40.0
        for k in range(40):
            distance = data[at + 4 + 2 * k] | data[at + 5 + 2 * k] << 8
            samples.append(((start + k * step) / 64.0 % 360.0, distance))
    return len(samples)


def report_rate(benchmark, samples):
    if benchmark.stats is not None:
        benchmark.extra_info["million_samples_per_second"] = round(samples / benchmark.stats.stats.median / 1e6, 2)


@pytest.mark.benchmark(group="RPLIDAR 0x81 in bulk")
def test_standard(benchmark):
    data = standard(SAMPLES)
    assert benchmark(decode, Answer.STANDARD, data, len(data)) == SAMPLES - 8
    report_rate(benchmark, SAMPLES)


@pytest.mark.benchmark(group="RPLIDAR 0x81 in bulk")
def test_standard_one_by_one(benchmark):
    data = standard(SAMPLES)
    assert benchmark(nodes_one_by_one, data) == SAMPLES
    report_rate(benchmark, SAMPLES)


@pytest.mark.benchmark(group="RPLIDAR 0x85 in bulk")
def test_dense(benchmark):
    data = dense(SAMPLES)
    assert benchmark(decode, Answer.DENSE, data, len(data)) == SAMPLES - 40
    report_rate(benchmark, SAMPLES)


@pytest.mark.benchmark(group="RPLIDAR 0x85 in bulk")
def test_dense_one_by_one(benchmark):
    data = dense(SAMPLES)
    assert benchmark(capsules_one_by_one, data) == SAMPLES - 40
    report_rate(benchmark, SAMPLES)
