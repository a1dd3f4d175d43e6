"""The four-parameter motion model and slip: mean and variance as stated, over 100,000 steps."""

import math

import numpy as np
import pytest

from features.se2 import wrap_angle
from sim import AlphaOdometry, OmniRobot, Robot, room_waypoints

STEPS = 100_000
OMNI = [False, True]


def assert_normal(sample, mean, variance):
    """Five standard errors of mean and variance of a normal sample: a right sampler fails once in two million."""
    assert abs(sample.mean() - mean) < 5.0 * math.sqrt(variance / sample.size)
    assert abs(sample.var() / variance - 1.0) < 5.0 * math.sqrt(2.0 / sample.size)


def increments(poses):
    """Motion of each step in the frame of the robot before it, shape (n, 3)."""
    steps = np.diff(poses[:, :2], axis=0)
    c, s = np.cos(poses[:-1, 2]), np.sin(poses[:-1, 2])
    ahead, aside = c * steps[:, 0] + s * steps[:, 1], -s * steps[:, 0] + c * steps[:, 1]
    return np.column_stack([ahead, aside, wrap_angle(np.diff(poses[:, 2]))])


def repeated(way, turn):
    """Poses of equal steps: a way straight ahead and then a turn on the spot."""
    headings = turn * np.arange(STEPS + 1)
    steps = way * np.column_stack([np.cos(headings[:-1]), np.sin(headings[:-1])])
    return np.column_stack([np.vstack([np.zeros(2), np.cumsum(steps, axis=0)]), wrap_angle(headings)])


def recorded(odometry, truth):
    return increments(odometry.record(truth, np.random.default_rng(0)))


@pytest.mark.parametrize("way", [0.5, -0.5])
def test_translation_from_translation(way):
    """Forwards and backwards."""
    steps = recorded(AlphaOdometry(alpha3=0.01), repeated(way, 0.0))
    assert_normal(steps[:, 0], way, 0.01 * 0.5**2)
    np.testing.assert_allclose(steps[:, 1:], 0.0, atol=1e-7)


def test_rotation_from_translation():
    """Each of the two turns of a step errs by alpha2 way^2."""
    steps = recorded(AlphaOdometry(alpha2=0.0004), repeated(0.5, 0.0))
    assert_normal(steps[:, 2], 0.0, 2.0 * 0.0004 * 0.5**2)
    first = np.arctan2(steps[:, 1], steps[:, 0])
    assert_normal(first, 0.0, 0.0004 * 0.5**2)
    np.testing.assert_allclose(np.hypot(*steps[:, :2].T), 0.5, atol=1e-7)


@pytest.mark.parametrize("turn", [0.3, 2.0, -0.3])
def test_rotation_from_rotation(turn):
    """On the spot all of the turn is in the second; more than a quarter of a turn, too."""
    steps = recorded(AlphaOdometry(alpha1=0.0004), repeated(0.0, turn))
    assert_normal(steps[:, 2], turn, 0.0004 * turn**2)
    assert (steps[:, :2] == 0.0).all()


def test_translation_from_rotation():
    steps = recorded(AlphaOdometry(alpha4=0.01), repeated(0.5, 0.3))
    assert_normal(steps[:, 0], 0.5, 0.01 * 0.3**2)
    np.testing.assert_allclose(steps[:, 2], 0.3, atol=1e-9)


def test_both_turns_of_a_step_count():
    """A step along a diagonal with the heading kept: a turn of 45 degrees, and back."""
    steps = np.column_stack([np.arange(STEPS + 1.0), np.arange(STEPS + 1.0), np.zeros(STEPS + 1)])
    found = recorded(AlphaOdometry(alpha1=0.0001), steps)
    assert_normal(found[:, 2], 0.0, 2.0 * 0.0001 * (math.pi / 4.0) ** 2)


def test_omnidirectional_base_errs_along_and_across_alike():
    """Sideways at a right angle: what would be two turns of a quarter for a differential drive is none."""
    sideways = np.column_stack([np.zeros(STEPS + 1), 0.5 * np.arange(STEPS + 1), np.zeros(STEPS + 1)])
    found = recorded(AlphaOdometry(0.5, 0.0, 0.01, 0.5, omnidirectional=True), sideways)
    assert_normal(found[:, 0], 0.0, 0.01 * 0.5**2)
    assert_normal(found[:, 1], 0.5, 0.01 * 0.5**2)
    np.testing.assert_allclose(found[:, 2], 0.0, atol=1e-12)
    found = recorded(AlphaOdometry(alpha1=0.0004, alpha2=0.0009, omnidirectional=True), repeated(0.5, 0.3))
    assert_normal(found[:, 2], 0.3, 0.0004 * 0.3**2 + 0.0009 * 0.5**2)


@pytest.mark.parametrize("omnidirectional", OMNI)
@pytest.mark.parametrize("way", [0.5, -0.5])
def test_slip_lengthens_the_way(way, omnidirectional):
    """A compound Poisson sum of exponentials: mean rate way length, variance 2 rate way length^2.

    Its fourth central moment is 24 rate way length^4 + 3 variance^2, which the bound on the variance takes.
    """
    odometry = AlphaOdometry(slip_rate=0.4, slip_length=0.05, omnidirectional=omnidirectional)
    extra = abs(recorded(odometry, repeated(way, 0.0))[:, 0]) - 0.5
    mean, variance = 0.4 * 0.5 * 0.05, 2.0 * 0.4 * 0.5 * 0.05**2
    assert abs(extra.mean() - mean) < 5.0 * math.sqrt(variance / STEPS)
    fourth = 24.0 * 0.4 * 0.5 * 0.05**4 + 3.0 * variance**2
    assert abs(extra.var() - variance) < 5.0 * math.sqrt((fourth - variance**2) / STEPS)
    assert extra.min() > -1e-7


@pytest.mark.parametrize("omnidirectional", OMNI)
def test_without_errors_it_is_the_truth_of_any_motion(omnidirectional):
    rng = np.random.default_rng(4)
    pushed = np.column_stack([rng.normal(size=(200, 2)), wrap_angle(np.cumsum(rng.uniform(-3.0, 3.0, 200)))])
    driven = Robot().drive(room_waypoints(), 50.0).poses_world_robot
    strafed = OmniRobot().drive([(0.0, 0.0, 0.0), (3.0, 0.0, 2.0), (3.0, 3.0, -2.0)], 50.0).poses_world_robot
    for truth in (pushed, driven, strafed, truth_at_rest := np.tile([1.0, 2.0, 3.0], (50, 1)), truth_at_rest[:1]):
        odom = AlphaOdometry(omnidirectional=omnidirectional).record(truth, rng)
        np.testing.assert_allclose(odom[:, :2], truth[:, :2], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(wrap_angle(odom[:, 2] - truth[:, 2]), 0.0, atol=1e-9)


def test_same_seed_gives_the_same_bytes():
    truth = Robot().drive(room_waypoints(), 50.0).poses_world_robot
    odometry = AlphaOdometry(0.01, 0.01, 0.01, 0.01, 0.1, 0.02)
    first, second, other = (odometry.record(truth, np.random.default_rng(seed)).tobytes() for seed in (1, 1, 2))
    assert first == second != other


@pytest.mark.parametrize(
    ("change", "message"), [({"alpha1": -1.0}, "alpha1 is -1"), ({"slip_rate": math.inf}, "slip_rate is inf")]
)
def test_impossible_error_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        AlphaOdometry(**change)
