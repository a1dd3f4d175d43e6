"""Odometry: the truth without errors, the stated mean and variance with them, at any step length."""

import math

import numpy as np
import pytest

from features.se2 import between, wrap_angle
from sim import POOR_ODOMETRY, Robot, WheelOdometry, room_waypoints

RUNS = 2000
FIVE_SIGMA_MEAN = 5.0 / math.sqrt(RUNS)
FIVE_SIGMA_VARIANCE = 5.0 * math.sqrt(2.0 / RUNS)
"""Five standard errors of mean (of a standard deviation) and variance (relative) of a normal sample."""

LENGTH = 10.0
TURN = 4.0 * math.pi


def straight(steps):
    return np.column_stack([np.linspace(0.0, LENGTH, steps + 1), np.zeros((steps + 1, 2))])


def on_the_spot(steps):
    return np.column_stack([np.zeros((steps + 1, 2)), wrap_angle(np.linspace(0.0, TURN, steps + 1))])


def last_poses(odometry, truth, seed=0):
    """Last odometry pose of many runs, shape (RUNS, 3)."""
    rng = np.random.default_rng(seed)
    return np.array([odometry.record(truth, rng)[-1] for _ in range(RUNS)])


def assert_normal(samples, mean, variance):
    assert abs(samples.mean() - mean) < FIVE_SIGMA_MEAN * math.sqrt(variance)
    assert abs(samples.var() / variance - 1.0) < FIVE_SIGMA_VARIANCE


def test_without_errors_it_is_the_truth():
    """1e-9 m: rounding of a few thousand steps."""
    truth = Robot().drive(room_waypoints(), 50.0).poses_world_robot
    odom = WheelOdometry().record(truth, np.random.default_rng(0))
    np.testing.assert_allclose(odom[:, :2], truth[:, :2], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(wrap_angle(odom[:, 2] - truth[:, 2]), 0.0, atol=1e-9)


def test_without_errors_it_is_the_truth_of_any_motion():
    """Sideways and backwards too, as when a robot is pushed; steps turn by less than half a turn."""
    rng = np.random.default_rng(4)
    truth = np.column_stack([rng.normal(size=(200, 2)), wrap_angle(np.cumsum(rng.uniform(-3.0, 3.0, 200)))])
    odom = WheelOdometry().record(truth, rng)
    np.testing.assert_allclose(odom[:, :2], truth[:, :2], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(wrap_angle(odom[:, 2] - truth[:, 2]), 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [20, 1000])
def test_translation_from_translation(steps):
    ends = last_poses(WheelOdometry(sigma_distance_per_metre=0.02), straight(steps))
    assert_normal(ends[:, 0], LENGTH, 0.02**2 * LENGTH)
    assert (ends[:, 1:] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("steps", [20, 1000])
def test_rotation_from_translation(steps):
    """The heading walks with sigma^2 L, which carries the end aside with sigma^2 L^3 / 3, whatever the step."""
    ends = last_poses(WheelOdometry(sigma_turn_per_metre=0.01), straight(steps))
    assert_normal(ends[:, 2], 0.0, 0.01**2 * LENGTH)
    assert_normal(ends[:, 1], 0.0, 0.01**2 * LENGTH**3 / 3.0)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [20, 1000])
def test_rotation_from_rotation(steps):
    ends = last_poses(WheelOdometry(sigma_turn_per_radian=0.03), on_the_spot(steps))
    assert_normal(ends[:, 2], 0.0, 0.03**2 * TURN)
    assert (ends[:, :2] == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("steps", [20, 1000])
def test_translation_from_rotation(steps):
    """Over two whole turns the walk is the same in x and y: half of sigma^2 phi each."""
    ends = last_poses(WheelOdometry(sigma_distance_per_radian=0.02), on_the_spot(steps))
    assert_normal(ends[:, 0], 0.0, 0.02**2 * TURN / 2.0)
    assert_normal(ends[:, 1], 0.0, 0.02**2 * TURN / 2.0)


def test_wheels_of_the_wrong_size_stretch_the_way():
    end = WheelOdometry(scale_left=1.03, scale_right=1.03).record(straight(50), np.random.default_rng(0))[-1]
    np.testing.assert_allclose(end, [1.03 * LENGTH, 0.0, 0.0], atol=1e-12)


def test_wheels_of_different_sizes_bend_a_straight_way():
    """A circle: heading L (right - left) / base, chord 2 R sin(heading / 2)."""
    odometry = WheelOdometry(scale_left=0.99, scale_right=1.01, wheel_base=0.5)
    end = odometry.record(straight(50), np.random.default_rng(0))[-1]
    heading = LENGTH * 0.02 / 0.5
    radius = LENGTH / heading
    np.testing.assert_allclose(
        end, [radius * math.sin(heading), radius * (1.0 - math.cos(heading)), heading], atol=1e-12
    )


def test_base_of_the_wrong_size_scales_the_turn():
    end = WheelOdometry(base_factor=0.95).record(on_the_spot(50), np.random.default_rng(0))[-1]
    np.testing.assert_allclose(end, [0.0, 0.0, wrap_angle(TURN / 0.95)], atol=1e-12)


def test_starts_at_the_true_first_pose_whatever_it_is():
    """A rigid motion of the truth moves the odometry with it: its steps are the same."""
    truth = Robot().drive([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)], 20.0).poses_world_robot
    angle, shift = 2.5, np.array([3.0, -1.0])
    c, s = math.cos(angle), math.sin(angle)
    turned = np.column_stack([truth[:, :2] @ np.array([[c, s], [-s, c]]) + shift, wrap_angle(truth[:, 2] + angle)])
    here = POOR_ODOMETRY.record(truth, np.random.default_rng(3))
    there = POOR_ODOMETRY.record(turned, np.random.default_rng(3))
    np.testing.assert_array_equal(there[0], turned[0])
    np.testing.assert_allclose(between(there[0], there[-1]), between(here[0], here[-1]), rtol=0.0, atol=1e-9)


def test_a_robot_at_rest_has_no_error():
    truth = np.tile([1.0, 2.0, 3.0], (100, 1))
    np.testing.assert_allclose(POOR_ODOMETRY.record(truth, np.random.default_rng(0)), truth, atol=1e-12)


def test_one_pose_is_a_record():
    truth = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_allclose(POOR_ODOMETRY.record(truth, np.random.default_rng(0)), truth, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [({"sigma_turn_per_metre": -1.0}, "sigma_turn_per_metre"), ({"base_factor": 0.0}, "base_factor")],
)
def test_impossible_error_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        WheelOdometry(**change)
