"""One update of the filter with ten corners: on the few rows that they touch, and dense as filterpy does it."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg import block_diag

from features.se2 import pose
from slam.filter.ekf import LandmarkEkf, corner_jacobian, predict_corners

CORNERS = 10
COUNTS = [10, 100, 400]


def problem(count, rng):
    """A filter with this many landmarks, and what it observes of the first ten."""
    ekf = LandmarkEkf(pose(0.0, 0.0, 0.3), 0.01 * np.eye(3))
    ekf.add_landmarks(rng.uniform(-20.0, 20.0, (count, 2)), 1e-3 * np.eye(2 * count))
    landmarks = np.arange(CORNERS)
    positions = predict_corners(ekf.x, landmarks) + 0.01 * rng.standard_normal((CORNERS, 2))
    return ekf, positions, np.repeat(1e-4 * np.eye(2)[None], CORNERS, axis=0), landmarks


def update_dense(x, P, positions, covs, landmarks):
    dense = ExtendedKalmanFilter(dim_x=x.size, dim_z=2 * CORNERS)
    dense.x, dense.P = x, P
    dense.update(
        positions.ravel(),
        lambda x: corner_jacobian(x, landmarks).toarray(),
        lambda x: predict_corners(x, landmarks).ravel(),
        R=block_diag(*covs),
    )
    return dense


@pytest.mark.parametrize("count", COUNTS)
def test_update_sparse(benchmark, rng, count):
    benchmark.group = f"update with {CORNERS} corners, {count} landmarks"
    ekf, *observation = problem(count, rng)
    x, P = ekf.x, ekf.P

    def update():
        ekf.x, ekf.P = x, P
        ekf.observe(*observation)

    benchmark(update)
    assert ekf.x.size == 3 + 2 * count


@pytest.mark.parametrize("count", COUNTS)
def test_update_filterpy(benchmark, rng, count):
    benchmark.group = f"update with {CORNERS} corners, {count} landmarks"
    ekf, *observation = problem(count, rng)
    dense = benchmark(update_dense, ekf.x, ekf.P, *observation)
    ekf.observe(*observation)
    np.testing.assert_allclose(ekf.P, dense.P, rtol=0, atol=1e-9)
