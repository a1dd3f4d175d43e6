"""Streams of each packet type for the tests: what a scanner would send, with any content."""

from dataclasses import dataclass

import numpy as np

from drivers.rplidar import (
    FORMATS,
    Answer,
    encode_dense,
    encode_express,
    encode_hq,
    encode_standard,
    encode_ultra,
    encode_ultra_dense,
)

MAX_MM = {
    Answer.STANDARD: 16383,
    Answer.EXPRESS: 16383,
    Answer.HQ: 60000,
    Answer.ULTRA: 28000,
    Answer.DENSE: 65535,
    Answer.ULTRA_DENSE: 65000,
}


@dataclass(frozen=True)
class Stream:
    """Packets of a scanner that turns steadily; ranges [m] of all samples in order."""

    answer: Answer
    packets: list[bytes]
    ranges: np.ndarray


def stream(
    answer: Answer, count: int, rng: np.random.Generator, *, first_deg: float = 0.0, step_deg: float = 0.4
) -> Stream:
    """Packets of a scanner that turns by ``step_deg`` per sample and sees noise in whole millimetres."""
    samples = FORMATS[answer].samples
    n = count * samples
    ranges = rng.integers(0, MAX_MM[answer], n) / 1000.0
    qualities = rng.integers(0, 256, n).astype(np.uint8)
    angles = np.radians(first_deg + step_deg * np.arange(n))
    turns = np.floor(angles / (2.0 * np.pi))
    starts = np.diff(turns, prepend=turns[0]) > 0
    packets = []
    for k in range(count):
        part = slice(k * samples, (k + 1) * samples)
        angle = angles[part][0] % (2.0 * np.pi)
        match answer:
            case Answer.STANDARD:
                packet = encode_standard(angles[part], ranges[part], qualities[part], starts[part])
            case Answer.EXPRESS:
                packet = encode_express(
                    angle, ranges[part], np.radians(rng.integers(0, 64, samples) / 8.0), restart=k == 0
                )
            case Answer.HQ:
                packet = encode_hq(angles[part], ranges[part], qualities[part], starts[part], time=k)
            case Answer.ULTRA:
                packet = encode_ultra(angle, ranges[part], rng.integers(0, 28000) / 1000.0, restart=k == 0)
            case Answer.DENSE:
                packet = encode_dense(angle, ranges[part], restart=k == 0)
            case _:
                packet = encode_ultra_dense(angle, ranges[part], qualities[part], restart=k == 0, time=k)
        packets.append(packet)
    return Stream(answer, packets, ranges)
