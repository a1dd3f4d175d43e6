"""The batch solve at the end of a run, beside the frames that led to it, and one key frame more by iSAM2."""

import itertools

import numpy as np
import pytest

from sim import room_run
from slam.config_file import load_config
from slam.graph.incremental import LandmarkGraph
from slam.graph.values import Observations
from slam.pipeline import Slam

FRAMES = 1500


@pytest.fixture(scope="module")
def frames():
    return list(itertools.islice(room_run(1), FRAMES))


def process(frames):
    source = room_run(1)
    slam = Slam(load_config(None, source=source.info))
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


def graph_of(key_frames, rng):
    """A drive past a wall of corners, each of which eight key frames see in a row; all but the last taken in."""
    graph = LandmarkGraph(2.0)
    covs = np.repeat(1e-4 * np.eye(2)[None], 4, axis=0)
    motion_cov = np.diag([0.01, 0.01, 0.003]) ** 2
    for key in range(key_frames + 1):
        corners = key // 2 + np.arange(4)
        positions = np.stack([0.6 * corners - 0.3 * key, np.full(4, 2.0)], axis=-1) + rng.normal(0.0, 0.01, (4, 2))
        motion = np.array([0.3, 0.0, 0.0]) + rng.normal(0.0, [0.01, 0.01, 0.003])
        graph.add_key_frame(np.zeros(3), motion, motion_cov, Observations(corners, positions, covs))
        if key < key_frames:
            graph.update()
    return graph


@pytest.mark.benchmark(group="graph: one key frame more, by iSAM2 and by a batch solve")
@pytest.mark.parametrize("key_frames", [100, 400, 1600])
@pytest.mark.parametrize("how", ["update", "optimize"])
def test_one_key_frame_more(benchmark, rng, how, key_frames):
    def prepared():
        return (graph_of(key_frames, rng),), {}

    if how == "update":
        benchmark.pedantic(LandmarkGraph.update, setup=prepared, rounds=10)
    else:
        graph = prepared()[0][0]
        graph.update()
        benchmark.pedantic(graph.optimize, args=(100,), rounds=3)
