"""What a registration says of the place it was made at: how certain a position is, and the closure that it makes."""

import math

import numpy as np
import pytest
from finite_difference import finite_difference

from features.se2 import between, compose, pose, wrap_angle
from slam.loop.rules import LoopRules
from slam.loop.verification import closure_of, position_sigma
from slam.odometry.registration import Registration

SYSTEMATIC = LoopRules().systematic_cov


def fit_of(seed, pose_map_robot):
    root = np.random.default_rng(seed).normal(size=(3, 5))
    information = 1e4 * root @ root.T
    return Registration(pose_map_robot, information, np.zeros(3), 0.9)


@pytest.mark.parametrize("seed", range(5))
def test_the_sigma_of_a_position_is_that_of_its_marginal_in_the_least_certain_direction(seed):
    """The heading is not known either: its error moves the position, and what it takes off counts."""
    fit = fit_of(seed, pose())
    marginal = np.linalg.inv(fit.information)[:2, :2]
    assert position_sigma(fit) == pytest.approx(math.sqrt(np.linalg.eigvalsh(marginal)[-1]), rel=1e-9)


@pytest.mark.parametrize("information", [np.zeros((3, 3)), np.diag([0.0, 1e6, 1e6]), np.diag([1e6, 1e6, 0.0])])
def test_a_scan_that_leaves_a_direction_open_tells_no_position(information):
    assert position_sigma(Registration(pose(), information, np.zeros(3), 0.9)) == math.inf


@pytest.mark.parametrize("seed", range(5))
def test_a_closure_is_the_motion_between_the_two_with_the_covariance_of_the_fit_carried_to_its_coordinates(seed):
    """And with what two registrations of one place share, which no scan tells."""
    older = pose(3.0, -2.0, 2.8)
    fit = fit_of(seed, compose(older, pose(0.4, 0.3, 0.7)))
    closure = closure_of(4, 90, older, fit, SYSTEMATIC)
    assert (closure.older, closure.newer) == (4, 90)
    np.testing.assert_allclose(closure.motion, [0.4, 0.3, 0.7], atol=1e-12)
    assert -math.pi <= closure.motion[2] < math.pi

    def difference(one, other):
        apart = one - other
        return np.array([*apart[:2], wrap_angle(float(apart[2]))])

    J = finite_difference(lambda newer: between(older, newer), fit.pose_map_robot, difference=difference)
    expected = J @ np.linalg.inv(fit.information) @ J.T + SYSTEMATIC
    np.testing.assert_allclose(closure.cov, expected, rtol=1e-8, atol=1e-14)
