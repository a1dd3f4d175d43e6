"""Motion composed of steps: its covariance does not depend on the steps and is that of Monte Carlo."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from features.se2 import between, compose, pose, wrap_angle
from slam.odometry import OdometryIncrement, OdometryModel

MODEL = OdometryModel(position_per_travel=0.05, position_per_turn=0.03, heading_per_travel=0.02, heading_per_turn=0.05)


def driven(steps, model=MODEL, start=pose(4.0, -3.0, 1.0)):  # noqa: B008, not written to
    increment = OdometryIncrement(model)
    here = start
    for step in steps:
        there = compose(here, step)
        increment.add(here, there)
        here = there
    return increment


def test_covariance_is_that_of_the_formula():
    cov = MODEL.covariance(pose(3.0, 4.0, -2.0))
    position = 0.05**2 * 5.0 + 0.03**2 * 2.0
    np.testing.assert_allclose(cov, np.diag([position, position, 0.02**2 * 5.0 + 0.05**2 * 2.0]))
    np.testing.assert_array_equal(MODEL.covariance(pose()), np.zeros((3, 3)))


@pytest.mark.parametrize("count", [1, 2, 10, 1000])
def test_straight_ahead_only_the_lateral_term_knows_of_the_steps(count):
    """Along the way and in heading variances add up; across it the early heading errors swing out, by eq. M11."""
    length = 2.0
    increment = driven([pose(length / count, 0.0, 0.0)] * count)
    assert increment.cov[0, 0] == pytest.approx(0.05**2 * length)
    assert increment.cov[2, 2] == pytest.approx(0.02**2 * length)
    steps = length / count * np.arange(count)
    lateral = 0.05**2 * length + 0.02**2 * np.sum(steps**2) * length / count
    assert increment.cov[1, 1] == pytest.approx(lateral)
    # In the limit of small steps: the integral of s^2.
    if count == 1000:
        assert increment.cov[1, 1] == pytest.approx(0.05**2 * length + 0.02**2 * length**3 / 3.0, rel=2e-3)


@pytest.mark.parametrize("count", [1, 7, 300])
def test_turning_on_the_spot_does_not_know_of_the_steps(count):
    increment = driven([pose(0.0, 0.0, 2.5 / count)] * count)
    np.testing.assert_allclose(increment.cov, np.diag([0.03**2 * 2.5, 0.03**2 * 2.5, 0.05**2 * 2.5]), atol=1e-15)
    assert increment.turn == pytest.approx(2.5)
    assert increment.travel == pytest.approx(0.0, abs=1e-12)


def test_covariance_is_that_of_monte_carlo():
    rng = np.random.default_rng(0)
    steps = [pose(0.15, 0.0, 0.05)] * 20 + [pose(0.1, 0.02, -0.12)] * 15
    increment = driven(steps)
    count = 20_000
    x, y, theta = np.zeros((3, count))
    for dx, dy, turn in steps:
        sigmas = np.sqrt(np.diag(MODEL.covariance(pose(dx, dy, turn))))[:, None]
        ex, ey, et = sigmas * rng.standard_normal((3, count))
        c, s = np.cos(theta), np.sin(theta)
        x, y = x + c * (dx + ex) - s * (dy + ey), y + s * (dx + ex) + c * (dy + ey)
        theta = theta + turn + et
    errors = np.stack([x, y, theta]) - increment.motion[:, None]
    sigmas = np.sqrt(np.diag(increment.cov))
    # Sampling error of 1 to 1.4 % a correlation and a few per cent that the linearisation leaves out at 0.1 rad.
    np.testing.assert_allclose(
        np.cov(errors) / np.outer(sigmas, sigmas), increment.cov / np.outer(sigmas, sigmas), atol=0.05
    )


poses = st.builds(pose, st.floats(-20, 20), st.floats(-20, 20), st.floats(-math.pi, math.pi))


@given(st.lists(poses, max_size=6), poses)
def test_motion_is_that_between_the_ends_in_any_frame(steps, start):
    increment = driven(steps, start=start)
    here = start
    for step in steps:
        here = compose(here, step)
    difference = increment.motion - between(start, here)
    difference[2] = wrap_angle(difference[2])
    np.testing.assert_allclose(difference, 0.0, atol=1e-10)
    np.testing.assert_allclose(increment.cov, driven(steps).cov, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(increment.cov, increment.cov.T, rtol=1e-12, atol=1e-12)
    assert np.linalg.eigvalsh(increment.cov).min() >= -1e-10 * max(1.0, np.abs(increment.cov).max())


def test_reset_starts_again_from_no_motion():
    increment = driven([pose(1.0, 2.0, 3.0)])
    increment.reset()
    np.testing.assert_array_equal(increment.motion, np.zeros(3))
    np.testing.assert_array_equal(increment.cov, np.zeros((3, 3)))
    increment.add(pose(5.0, 5.0, 1.0), pose(5.0, 5.0, 1.0))
    np.testing.assert_array_equal(increment.cov, np.zeros((3, 3)))
    assert (increment.travel, increment.turn) == (0.0, 0.0)
