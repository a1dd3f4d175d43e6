"""Odometry with a jump in one record: the motions on either side of it are those of the odometry without it."""

import itertools

import numpy as np
import pytest

from features.se2 import between, compose, pose
from sim.motion.jumping_odometry import JumpingOdometry
from sim.motion.odometry import WheelOdometry
from sim.motion.robot import Robot

POSES = Robot().drive([(0.0, 0.0), (2.0, 1.0), (2.0, 3.0)], 20.0).poses_world_robot


def recorded(at, motion):
    return JumpingOdometry(WheelOdometry(), at, motion).record(POSES, np.random.default_rng(0))


def steps(poses):
    return np.array([between(a, b) for a, b in itertools.pairwise(poses)])


@pytest.mark.parametrize("motion", [pose(1.0, -0.5, 0.7), pose(0.0, 0.0, -1.5)])
def test_the_step_of_the_record_and_no_other_has_the_jump(motion):
    plain, jumped = WheelOdometry().record(POSES, np.random.default_rng(0)), recorded(30, motion)
    np.testing.assert_allclose(np.delete(steps(jumped), 29, axis=0), np.delete(steps(plain), 29, axis=0), atol=1e-12)
    np.testing.assert_allclose(steps(jumped)[29], compose(steps(plain)[29], motion), atol=1e-12)


def test_odometry_that_starts_anew_is_at_zero():
    jumped = recorded(30, None)
    np.testing.assert_array_equal(jumped[30], np.zeros(3))
    np.testing.assert_array_equal(jumped[:30], recorded(len(POSES), None)[:30])


def test_the_first_record_cannot_jump():
    with pytest.raises(ValueError, match="at is 0"):
        recorded(0, None)
