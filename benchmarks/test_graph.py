"""The batch solve at the end of a run through the room, beside the frames that led to it."""

import itertools

import numpy as np
import pytest

from sim.run import room_run
from slam.config import load_config
from slam.pipeline import Slam

FRAMES = 1500


@pytest.fixture(scope="module")
def frames():
    return list(itertools.islice(room_run(1), FRAMES))


def process(frames):
    source = room_run(1)
    slam = Slam(load_config(None, source_preset=source.sensor, source_mounting=source.mounting))
    for frame in frames:
        slam.process(frame)
    return slam


@pytest.mark.benchmark(group=f"a run of {FRAMES} records")
def test_batch_solve(benchmark, frames):
    slam = process(frames)
    result = benchmark(slam.finish)
    assert np.isfinite(result.landmarks.covs).all()


@pytest.mark.benchmark(group=f"a run of {FRAMES} records")
def test_all_frames(benchmark, frames):
    slam = benchmark.pedantic(process, args=(frames,), rounds=5, warmup_rounds=1)
    assert slam.scans == FRAMES // 5
