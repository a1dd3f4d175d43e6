"""One step of the front end, associate and update with eight corners: it grows with the filter, not with the map."""

import math

import numpy as np
import pytest

from features.feature import Corners
from features.se2 import pose
from features.signature import Signatures
from slam.filter.association import Gates
from slam.filter.ekf import predict_corners
from slam.filter.front_end import FrontEnd

SEEN = 8
KEEP = 20.0


def corners(positions):
    k = len(positions)
    covs = np.repeat(1e-4 * np.eye(2)[None], k, axis=0)
    return Corners.of(positions, covs, Signatures(np.zeros(k, np.int64), np.full(k, math.pi / 2), np.zeros(k)))


def front_end(local, known, rng):
    """A front end with this many landmarks in the filter, a grid of one in two square metres, and the rest at rest."""
    gates = Gates("joint", 0.99, 0.9999, 0.5, math.radians(20.0), math.radians(30.0))
    front = FrontEnd(pose(), 1e-4 * np.eye(3), gates, KEEP)
    for first in range(0, known - local, 100):
        count = min(100, known - local - first)
        front.observe(corners(1.4 * (np.stack(np.divmod(np.arange(count), 10), axis=-1) - 4.5)))
        front.move(pose(3.0 * KEEP, 0.0, 0.0), 1e-6 * np.eye(3))
        front.deactivate_far(0, np.empty(0, np.int64))
    side = math.ceil(math.sqrt(local))
    grid = 1.4 * (np.stack(np.divmod(np.arange(local), side), axis=-1) - (side - 1) / 2.0)
    front.observe(corners(grid + rng.uniform(-0.2, 0.2, grid.shape)))
    front.move(pose(0.1, 0.0, 0.02), np.diag([0.01, 0.01, 0.005]) ** 2)
    assert (front.active.size, len(front.table)) == (local, known)
    return front


def measure(benchmark, local, known, rng):
    front = front_end(local, known, rng)
    nearest = np.argsort(np.hypot(*(front.ekf.landmarks - front.ekf.pose[:2]).T))[:SEEN]
    positions = predict_corners(front.ekf.x, nearest) + rng.normal(0.0, 0.01, (SEEN, 2))
    x, P = front.ekf.x, front.ekf.P
    seen = corners(positions)

    def step():
        front.ekf.x, front.ekf.P = x, P
        return front.observe(seen)

    _, landmarks = benchmark(step)
    assert sorted(landmarks.tolist()) == sorted(front.active[nearest].tolist())


@pytest.mark.benchmark(group=f"front end: {SEEN} corners, 10 landmarks in the filter, by landmarks known in all")
@pytest.mark.parametrize("known", [10, 100, 1000, 5000])
def test_step_by_landmarks_known(benchmark, rng, known):
    measure(benchmark, 10, known, rng)


@pytest.mark.benchmark(group=f"front end: {SEEN} corners, by landmarks in the filter of 1000 known")
@pytest.mark.parametrize("local", [10, 30, 60, 100])
def test_step_by_landmarks_in_the_filter(benchmark, rng, local):
    measure(benchmark, local, 1000, rng)
