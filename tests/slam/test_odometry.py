"""What is expected of a motion: by the wheels, and without them by the velocity before."""

import numpy as np
import pytest

from features.se2 import between, compose, pose
from slam.drifting_pose import DriftingPose
from slam.odometry import ConstantVelocity, OdometryModel, WheelMotion

MODEL = OdometryModel(position_per_travel=0.05, position_per_turn=0.03, heading_per_travel=0.02, heading_per_turn=0.05)


def test_covariance_is_that_of_the_formula():
    cov = MODEL.covariance(pose(3.0, 4.0, -2.0))
    position = 0.05**2 * 5.0 + 0.03**2 * 2.0
    np.testing.assert_allclose(cov, np.diag([position, position, 0.02**2 * 5.0 + 0.05**2 * 2.0]))
    np.testing.assert_array_equal(MODEL.covariance(pose()), np.zeros((3, 3)))


def test_wheels_tell_the_motion_between_records():
    wheels = WheelMotion(MODEL)
    first, second = pose(1.0, 2.0, 3.0), pose(1.3, 1.8, -3.0)
    motion, cov = wheels.step(0.0, first)
    np.testing.assert_array_equal(motion, np.zeros(3))
    np.testing.assert_array_equal(cov, np.zeros((3, 3)))
    motion, cov = wheels.step(0.1, second)
    np.testing.assert_allclose(motion, between(first, second))
    np.testing.assert_allclose(cov, MODEL.covariance(motion))


def since_scan(motion):
    """An anchor that a motion, known to a millimetre and a milliradian, lies behind."""
    drifting = DriftingPose(pose())
    anchor = drifting.anchor()
    drifting.move(motion, 1e-6 * np.eye(3))
    return anchor


def test_velocity_goes_on_whatever_the_interval():
    source = ConstantVelocity(0.5, 1.0)
    source.step(10.0, pose())
    source.learn(10.0, since_scan(pose()))
    source.step(10.2, pose(7.0, 7.0, 1.0))
    source.learn(10.2, since_scan(pose(0.1, 0.0, 0.02)))
    motion, _ = source.step(10.5, pose(-7.0, 3.0, 2.0))
    np.testing.assert_allclose(motion, [0.15, 0.0, 0.03])


def test_covariance_does_not_know_of_the_records_between_two_scans():
    """Eq. M34 is of the time since the last scan: in one step or in seven it comes to the same."""
    covs = []
    for count in (1, 7):
        source = ConstantVelocity(0.5, 1.0)
        source.step(0.0, pose())
        source.learn(0.0, since_scan(pose()))
        source.step(0.2, pose())
        source.learn(0.2, since_scan(pose(0.1, 0.0, 0.0)))
        steps = [source.step(0.2 + 0.4 * (k + 1) / count, pose())[1] for k in range(count)]
        covs.append(np.sum(steps, axis=0))
        assert all(np.diag(cov).min() > 0.0 for cov in steps)
    np.testing.assert_allclose(covs[0], covs[1])


def test_covariance_is_that_of_velocities_that_walk_at_random():
    """Monte Carlo of white acceleration: the motion of an interval, foreseen by the mean velocity of the one before."""
    rng = np.random.default_rng(0)
    sigma, before, after, count = 0.5, 0.3, 0.2, 100
    dt = 0.1 / 20
    steps_before, steps_after = round(before / dt), round(after / dt)
    speeds = 1.0 + np.cumsum(
        sigma * np.sqrt(dt) * rng.standard_normal((20 * count, steps_before + steps_after)), axis=1
    )
    way_before = speeds[:, :steps_before].sum(axis=1) * dt
    way_after = speeds[:, steps_before:].sum(axis=1) * dt
    errors = way_after - way_before * after / before

    source = ConstantVelocity(sigma, 1.0)
    source.step(0.0, pose())
    source.learn(0.0, since_scan(pose()))
    source.step(before, pose())
    source.learn(before, since_scan(pose(before, 0.0, 0.0)))
    _, cov = source.step(before + after, pose())
    known = 1e-6 * (after / before) ** 2
    # 2000 samples know a variance to 3 %; steps of 5 ms instead of an integral cost 2 %.
    assert np.var(errors) == pytest.approx(cov[0, 0] - known, rel=0.12)


def test_two_scans_of_one_stamp_leave_the_velocity():
    source = ConstantVelocity(0.5, 1.0)
    for stamp, motion in [(0.0, pose()), (0.2, pose(0.1, 0.0, 0.0)), (0.2, pose(0.001, 0.0, 0.0))]:
        source.step(stamp, pose())
        source.learn(stamp, since_scan(motion))
    motion, cov = source.step(0.4, pose())
    np.testing.assert_allclose(motion, [0.1, 0.0, 0.0])
    assert np.isfinite(cov).all()
    assert np.allclose(compose(pose(), motion), motion)
