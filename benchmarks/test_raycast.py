"""Ranges of 920 beams in the room: each wall laid on its beams, and all beams with all walls."""

import numpy as np
import pytest

from sim.raycast import cast
from sim.worlds import room

ORIGIN = np.array([2.0, 2.0])
ANGLES = np.linspace(-np.pi, np.pi, 920, endpoint=False)


def cast_all_pairs(walls, origin, angles):
    """Intersect every beam with every wall in one numpy expression."""
    starts, along = walls[:, :2] - origin, walls[:, 2:] - walls[:, :2]
    dx, dy = np.cos(angles)[:, None], np.sin(angles)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = dx * along[:, 1] - dy * along[:, 0]
        distance = (starts[:, 0] * along[:, 1] - starts[:, 1] * along[:, 0]) / crossing
        share = (starts[:, 0] * dy - starts[:, 1] * dx) / crossing
    hit = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    return np.where(hit, distance, np.inf).min(axis=1)


@pytest.mark.benchmark(group="ray casting, 920 beams in the room")
def test_cast_compiled(benchmark):
    ranges, _ = benchmark(cast, room().walls, ORIGIN, ANGLES)
    assert np.isfinite(ranges).all()


@pytest.mark.benchmark(group="ray casting, 920 beams in the room")
def test_cast_numpy_all_pairs(benchmark):
    ranges = benchmark(cast_all_pairs, room().walls, ORIGIN, ANGLES)
    np.testing.assert_allclose(ranges, cast(room().walls, ORIGIN, ANGLES)[0], rtol=0, atol=1e-9)
