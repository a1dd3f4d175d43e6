"""Systematic errors of wheels, learned from scans: found where scans show the motion, left alone where they do not."""

import math

import numpy as np
import pytest

from features.se2 import compose, pose
from sim import POOR_ODOMETRY, room_run
from slam.config import SlamConfig
from slam.odometry.cloned_pose import ClonedPose
from slam.odometry.motion_models import OdometryModel
from slam.odometry.rules import CalibrationRules
from slam.odometry.wheel_calibration import Calibration, WheelCalibration
from slam.pipeline import Slam

MODEL = OdometryModel(position_per_travel=0.02, position_per_turn=0.01, heading_per_travel=0.02, heading_per_turn=0.03)
WRONG = np.array([-0.03, 0.04, 0.02])
"""What has to be added to the motion that the wheels of these tests report."""

TELLING = np.diag([1e4, 1e4, 1e5])
"""Information of a scan that tells a pose to 1 cm and 0.2 deg."""


def append(wheels, said, cov):
    """Append a motion that wheels tell to a stretch, corrected."""
    corrected = wheels.corrected(said)
    wheels.move(corrected, cov)
    return corrected


def reported(motion, wrong=WRONG):
    """Motion that wheels report of a true one."""
    x, y, turn = motion
    true_turn = (turn - wrong[2] * x / (1.0 + wrong[0])) / (1.0 + wrong[1])
    return np.array([x / (1.0 + wrong[0]), y / (1.0 + wrong[0]), true_turn])


def drive(wheels, rng, steps=2000, information=TELLING, wrong=WRONG):
    """Drive a robot about whose scans tell ``information`` of each pose; both err as they say."""
    drifting = ClonedPose(pose())
    since = drifting.clone()
    truth = pose()
    for _ in range(steps):
        step = np.array([0.1, 0.0, rng.uniform(-0.3, 0.3)])
        truth = compose(truth, step)
        cov = MODEL.covariance(step)
        said = reported(step, wrong) + np.sqrt(np.diagonal(cov)) * rng.standard_normal(3)
        drifting.move(append(wheels, said, cov), cov)
        axes, values, _ = np.linalg.svd(information)
        seen = truth + axes @ (np.where(values > 0.0, values, np.inf) ** -0.5 * rng.standard_normal(3))
        change = seen - drifting.pose
        change[2] = (change[2] + math.pi) % (2.0 * math.pi) - math.pi
        drifting.correct(information, information @ change)
        if wheels.learn(since):
            since.reset()


def state(wheels):
    calibration = wheels.calibration
    return np.array([calibration.travel, calibration.turn, calibration.drift])


@pytest.mark.slow
def test_what_wheels_tell_wrongly_is_found_within_its_covariance():
    """40 robots; the mean of the squared Mahalanobis distances is chi-square, to 4 sigma, and no more than stated.

    Errors of neighbouring stretches share that of the scan between them with opposite signs, so it may be less.
    """
    distances = []
    for seed in range(40):
        wheels = WheelCalibration()
        drive(wheels, np.random.default_rng(seed), steps=400)
        error = state(wheels) - WRONG
        distances.append(error @ np.linalg.solve(wheels.cov, error))
        assert np.sqrt(np.diagonal(wheels.cov)).max() < 0.02
    assert 1.0 < np.mean(distances) < 3.0 + 4.0 * math.sqrt(6.0 / 40)


def test_wheels_that_are_right_stay_as_they_are():
    wheels = WheelCalibration()
    drive(wheels, np.random.default_rng(0), wrong=np.zeros(3))
    assert (abs(state(wheels)) < 4.0 * np.sqrt(np.diagonal(wheels.cov))).all()


def test_without_scans_nothing_is_learned():
    wheels = WheelCalibration()
    drive(wheels, np.random.default_rng(1), information=np.zeros((3, 3)))
    assert wheels.calibration == Calibration()
    np.testing.assert_allclose(wheels.cov, CalibrationRules().first_cov, rtol=1e-12)


def test_headings_alone_tell_the_turn_and_not_the_travel():
    wheels = WheelCalibration()
    drive(wheels, np.random.default_rng(2), information=np.diag([0.0, 0.0, 1e6]))
    error, sigma = state(wheels) - WRONG, np.sqrt(np.diagonal(wheels.cov))
    assert sigma[0] > 0.03  # of 0.05: a bent way tells a little of its length by its heading
    assert sigma[1] < 0.01
    assert (abs(error) < 4.0 * sigma).all()


def test_wheels_that_slip_or_stand_still_teach_nothing():
    wheels = WheelCalibration()
    drifting = ClonedPose(pose())
    since = drifting.clone()
    for said in (pose(), pose(0.2, 0.0, 0.0)):
        for _ in range(12):
            cov = MODEL.covariance(said)
            append(wheels, said, cov)
            drifting.move(pose(0.5, 0.0, 0.0), np.diag([1e-6, 1e-6, 1e-8]))
            if wheels.learn(since):
                since.reset()
    assert wheels.calibration == Calibration()


def test_a_short_motion_is_not_compared():
    wheels, drifting = WheelCalibration(), ClonedPose(pose())
    since = drifting.clone()
    drifting.move(pose(0.9, 0.0, 0.9), MODEL.covariance(pose(0.9, 0.0, 0.9)))
    assert not wheels.learn(since)
    drifting.move(pose(0.2, 0.0, 0.0), MODEL.covariance(pose(0.2, 0.0, 0.0)))
    assert wheels.learn(since)


@pytest.mark.slow
def test_a_run_through_the_room_finds_the_wheels_of_the_simulator():
    """Both wheels are too large, the right one by more, and the base too narrow."""
    run = room_run(5)
    slam = Slam(SlamConfig.of_preset(run.sensor))
    for frame in run:
        slam.process(frame)
    found = slam.finish().metrics.wheels
    assert found is not None
    left, right, base = POOR_ODOMETRY.scale_left, POOR_ODOMETRY.scale_right, POOR_ODOMETRY.base_factor
    travel = 2.0 / (left + right) - 1.0
    turn = 2.0 * base / (left + right) - 1.0
    drift = -(right - left) / (POOR_ODOMETRY.wheel_base * base) * 2.0 / (left + right)
    # Of 39 m and some 40 rad the wheels tell these to about a hundredth.
    assert found.travel == pytest.approx(travel, abs=0.025)
    assert found.turn == pytest.approx(turn, abs=0.03)
    assert found.drift == pytest.approx(drift, abs=0.02)


def test_a_turn_is_compared_across_the_cut_of_angles():
    """Wheels that tell half a turn and five degrees more: by the scans it is five degrees less, no whole turn away."""
    wheels, drifting = WheelCalibration(), ClonedPose(pose())
    since = drifting.clone()
    cov = np.diag([1e-4, 1e-4, math.radians(10.0) ** 2])
    append(wheels, pose(0.0, 0.0, math.radians(185.0)), cov)
    drifting.move(pose(0.0, 0.0, math.radians(175.0)), np.diag([1e-6, 1e-6, 1e-8]))
    assert wheels.learn(since)
    # What has to be added is 10 deg a turn of 185, of which a single one of 10 deg of chance tells a part.
    assert -10.0 / 175.0 < wheels.calibration.turn < 0.0
