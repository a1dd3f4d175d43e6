"""Bags that are cut short or damaged: what came before is read, then one line says so, and nothing else is raised."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from bags import KINDS, START, Messages
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import Frame, LogFormatError, open_log

COUNT = 60
RANGES = np.linspace(1.0, 4.0, 300)


@dataclass(frozen=True, slots=True)
class Bag:
    """A bag of scans: the path to open, its file and the bytes of this."""

    path: Path
    file: Path
    data: bytes = field(repr=False)


@pytest.fixture(scope="module", params=[*KINDS, "rosbag1 in one chunk"])
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bag:
    kind, _, in_one = request.param.partition(" ")
    messages = Messages(kind)
    for k in range(COUNT):
        messages.scan(START + 0.1 * k, RANGES + 0.01 * k)
    folder = tmp_path_factory.mktemp("bag")
    path = messages.write(folder, chunk=None if in_one else 4_000)
    file = path if path.is_file() else next(found for found in path.iterdir() if found.suffix != ".yaml")
    return Bag(path, file, file.read_bytes())


def read(path: Path) -> tuple[list[Frame], str]:
    """Frames of a bag, and the message of the error after them, if any."""
    frames: list[Frame] = []
    try:
        frames.extend(open_log(path))
    except LogFormatError as error:
        return frames, str(error)
    return frames, ""


def check(frames: list[Frame]) -> None:
    """Every scan is what was written at its stamp, to single precision."""
    for frame in frames:
        k = round((frame.stamp - START) / 0.1)
        np.testing.assert_allclose(frame.scan.ranges, RANGES + 0.01 * k, atol=1e-6)


def test_what_is_before_the_cut_is_read(bag):
    """Most of what half a file holds, beside its indices; a cut in the last bytes loses no scan, or says so."""
    bag.file.write_bytes(bag.data[: len(bag.data) // 2])
    frames, error = read(bag.path)
    check(frames)
    assert 0.25 * COUNT < len(frames) <= 0.6 * COUNT
    assert "cut short or damaged" in error
    assert "\n" not in error


@settings(max_examples=25)
@given(share=st.floats(0.0, 1.0))
def test_a_cut_anywhere_is_one_line(bag, share):
    bag.file.write_bytes(bag.data[: int(share * len(bag.data))])
    frames, error = read(bag.path)
    check(frames)
    assert len(frames) == COUNT or error
    assert "\n" not in error


@pytest.mark.slow
@settings(max_examples=50)
@given(place=st.floats(0.0, 1.0, exclude_max=True), garbage=st.binary(min_size=1, max_size=200))
def test_garbage_anywhere_is_one_line(bag, place, garbage):
    """Numbers may be wrong where the bag has no checksum, but nothing else than our error comes of it."""
    start = int(place * len(bag.data))
    bag.file.write_bytes(bag.data[:start] + garbage + bag.data[start + len(garbage) :])
    _, error = read(bag.path)
    assert "\n" not in error
