"""What is expected of a motion: by the wheels, and without them by the velocity before."""

import math

import numpy as np
import pytest

from features.se2 import between, compose, pose
from slam.odometry.cloned_pose import ClonedPose
from slam.odometry.motion_models import ConstantVelocity, OdometryModel, WheelMotion, WheelSpeeds, taken_back

MODEL = OdometryModel(position_per_travel=0.05, position_per_turn=0.03, heading_per_travel=0.02, heading_per_turn=0.05)


def test_covariance_is_that_of_the_formula():
    cov = MODEL.covariance(pose(3.0, 4.0, -2.0))
    position = 0.05**2 * 5.0 + 0.03**2 * 2.0
    np.testing.assert_allclose(cov, np.diag([position, position, 0.02**2 * 5.0 + 0.05**2 * 2.0]))
    np.testing.assert_array_equal(MODEL.covariance(pose()), np.zeros((3, 3)))


def test_wheels_tell_the_motion_between_records():
    wheels = WheelMotion(MODEL, WheelSpeeds(10.0, 100.0))
    first, second = pose(1.0, 2.0, 3.0), pose(1.3, 1.8, -3.0)
    motion, cov = wheels.step(0.0, first)
    np.testing.assert_array_equal(motion, np.zeros(3))
    np.testing.assert_array_equal(cov, np.zeros((3, 3)))
    motion, cov = wheels.step(0.1, second)
    np.testing.assert_allclose(motion, between(first, second))
    np.testing.assert_allclose(cov, MODEL.covariance(motion))


def test_a_step_back_takes_back_what_was_appended():
    """Pose, covariance and what a clone shares with them are those of the earlier time; one forwards is as ever."""
    records = [(0.1, pose(1.0, 2.0, 3.0)), (0.2, pose(1.3, 1.8, -3.0)), (0.3, pose(1.5, 1.9, -2.7))]
    straight, back = driven_by_wheels(records[:2]), driven_by_wheels([*records, records[1]])
    for further in ([], [records[2]]):
        one, other = (driven_on(of, further) for of in (straight, back))
        np.testing.assert_allclose(one[0].pose, other[0].pose, atol=1e-12)
        np.testing.assert_allclose(one[0].cov, other[0].cov, atol=1e-15)
        np.testing.assert_allclose(one[2].motion_cov, other[2].motion_cov, atol=1e-15)


def driven_by_wheels(records):
    drifting, wheels = ClonedPose(pose()), WheelMotion(MODEL, WheelSpeeds(10.0, 100.0))
    drifting.move(pose(0.3, 0.1, 0.4), 1e-4 * np.eye(3))
    return driven_on((drifting, wheels, drifting.clone()), records)


def driven_on(of, records):
    drifting, wheels, _ = of
    for record in records:
        drifting.move(*wheels.step(*record))
    return of


def test_a_step_back_behind_the_last_scan_is_a_motion_with_errors_of_its_own():
    wheels = WheelMotion(MODEL, WheelSpeeds(10.0, 100.0))
    wheels.step(0.1, pose(1.0))
    wheels.learn(0.1, since_scan(pose()))
    motion, cov = wheels.step(0.08, pose(0.9))
    np.testing.assert_allclose(motion, [-0.1, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(cov, MODEL.covariance(motion))


def test_what_is_taken_back_leaves_nothing():
    rng = np.random.default_rng(0)
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        motion, cov = pose(*rng.normal(size=3)), root @ root.T
        drifting = ClonedPose(pose(*rng.normal(size=3)))
        drifting.move(pose(0.1, 0.2, 0.3), 0.01 * np.eye(3))
        before, cov_before = drifting.pose.copy(), drifting.cov.copy()
        drifting.move(motion, cov)
        drifting.move(*taken_back(motion, cov))
        np.testing.assert_allclose(drifting.pose, before, atol=1e-12)
        np.testing.assert_allclose(drifting.cov, cov_before, atol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_without_wheels_a_step_back_takes_back_too(turn):
    source, other = constant_velocity(), constant_velocity()
    for each in (source, other):
        drive(each, [(0.0, pose()), (0.1, pose(0.05, 0.0, turn))])
    drifting, straight = ClonedPose(pose()), ClonedPose(pose())
    for stamp in (0.15, 0.2, 0.15):
        drifting.move(*source.step(stamp, pose()))
    straight.move(*other.step(0.15, pose()))
    np.testing.assert_allclose(drifting.pose, straight.pose, atol=1e-12)
    np.testing.assert_allclose(drifting.cov, straight.cov, atol=1e-12)
    motion, cov = source.step(0.05, pose())
    assert np.isfinite(motion).all()
    assert np.isfinite(cov).all()


def driven(wheels, records):
    """Motions by the wheels between records of stamp and pose."""
    return [wheels.record(stamp, pose_odom)[0] for stamp, pose_odom in records]


def steady(speed, count, interval=0.02, start=0.0):
    """Records of a straight drive [m/s]."""
    return [(start + interval * k, pose(speed * interval * k)) for k in range(count)]


@pytest.mark.parametrize("step", [pose(0.3), pose(-0.3), pose(0.0, 0.3), pose(0.0, 0.0, 1.6), pose(5.0, 0.0, -1.6)])
def test_a_step_that_no_robot_makes_is_left_out_and_the_robot_goes_on(step):
    """The motion and the pose of the wheels go on as if nothing had happened, with a covariance of a step unknown."""
    records = steady(0.5, 100)
    jumped = [(stamp, compose(compose(records[60][1], step), between(records[60][1], at)) if k >= 60 else at)
              for k, (stamp, at) in enumerate(records)]  # fmt: skip
    wheels = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0))
    np.testing.assert_allclose(driven(wheels, jumped)[1:], np.tile(pose(0.01), (99, 1)), atol=1e-12)
    np.testing.assert_allclose(wheels.pose_odom, records[-1][1], atol=1e-12)
    assert [jump.stamp for jump in wheels.jumps] == [records[60][0]]
    _, cov = WheelSpeeds(1.0, 2.0).expected(0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(cov)), [0.02, 0.02, 0.04])


def test_steps_to_the_middle_of_sweeps_are_not_judged_and_a_jump_beside_them_is_left_out():
    """Back to the middle of each sweep and on again: the same jump, the same motion, the poses free of it."""
    records = steady(0.5, 100)
    jumped = [(stamp, compose(pose(1.0, 2.0, 0.5), at) if k >= 60 else at) for k, (stamp, at) in enumerate(records)]
    wheels, drifting = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0)), ClonedPose(pose())
    for k, record in enumerate(jumped):
        drifting.move(*wheels.record(*record))
        np.testing.assert_allclose(wheels.pose_odom, records[k][1], atol=1e-12)
        if k > 1:
            middle, behind = record[0] - 0.013, wheels.pose_log
            drifting.move(*wheels.step(middle, pose(0.5 * middle)))
            np.testing.assert_allclose(between(behind, wheels.pose_log), pose(-0.0065), atol=1e-12)
            wheels.learn(middle, since_scan(pose()))
    np.testing.assert_allclose(drifting.pose, pose(0.5 * middle), atol=1e-9)
    assert [jump.stamp for jump in wheels.jumps] == [records[60][0]]
    assert np.linalg.eigvalsh(drifting.cov).min() > 0.0


def test_wheels_that_start_anew_at_zero_jump_once():
    records = steady(0.5, 200)
    anew = records[:150] + [(stamp, pose(at[0] - records[150][1][0])) for stamp, at in records[150:]]
    wheels = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0))
    np.testing.assert_allclose(sum(driven(wheels, anew))[0], records[-1][1][0], atol=1e-9)
    assert len(wheels.jumps) == 1


def test_a_fast_robot_is_believed_once_it_has_shown_its_speed():
    """Ten times as fast as configured, from standing: after some records no jump any more; a jump still is."""
    wheels = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0))
    driven(wheels, steady(0.0, 50, start=-1.0))
    motions = driven(wheels, steady(10.0, 60))
    assert 1 <= len(wheels.jumps) <= 3
    np.testing.assert_allclose(motions[10:], np.tile(pose(0.2), (50, 1)), atol=1e-12)
    wheels.record(1.2, pose(12.0 + 5.0))
    assert wheels.jumps[-1].stamp == 1.2


def test_records_that_come_in_bursts_do_not_jump():
    """Of each ten records nine come at once, as in logs that were written late: the stamps tell no speed."""
    rng = np.random.default_rng(3)
    at = np.cumsum(rng.uniform(0.0, 0.06, 500))
    stamps = [0.1 * 10 * (k // 10 + 1) + 1e-3 * (k % 10) for k in range(500)]
    wheels = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0))
    driven(wheels, list(zip(stamps, (pose(x) for x in at), strict=True)))
    assert not wheels.jumps


def test_records_of_one_stamp_tell_no_speed():
    wheels = WheelMotion(MODEL, WheelSpeeds(1.0, 1.0))
    np.testing.assert_array_equal(driven(wheels, [(7.0, pose(0.1 * k)) for k in range(3)])[1:], [pose(0.1), pose(0.1)])


def since_scan(motion):
    """An anchor that a motion, known to a millimetre and a milliradian, lies behind."""
    drifting = ClonedPose(pose())
    anchor = drifting.clone()
    drifting.move(motion, 1e-6 * np.eye(3))
    return anchor


def constant_velocity(speed=1.0, speed_change=0.5):
    return ConstantVelocity(speed, 1.0, speed_change, 1.0)


def drive(source, records):
    """Feed stamps and motions, each known to a millimetre and a milliradian."""
    for stamp, motion in records:
        source.step(stamp, pose())
        source.learn(stamp, since_scan(motion))


def test_velocity_goes_on_whatever_the_interval():
    """With a memory of hours it does not die away: the motion is in proportion to the time."""
    source = ConstantVelocity(50.0, 50.0, 0.5, 0.5)
    drive(source, [(10.0, pose()), (10.2, pose(0.1, 0.0, 0.02))])
    motion, _ = source.step(10.5, pose(-7.0, 3.0, 2.0))
    np.testing.assert_allclose(motion, [0.15, 0.0, 0.03], rtol=1e-3, atol=1e-9)


def test_velocity_dies_away():
    """Half a minute after the last scan nothing is left of a memory of eight seconds: the rest is a random walk."""
    source = constant_velocity()
    drive(source, [(0.0, pose()), (0.2, pose(0.1, 0.0, 0.0))])
    motions, covs = zip(*(source.step(0.2 + 40.0 * k, pose()) for k in range(1, 4)), strict=True)
    assert 2.0 < motions[0][0] < 4.0
    assert abs(motions[2][0]) < 1e-3
    # The variance of such a walk grows by 2 sigma^2 T a second.
    assert covs[2][0, 0] == pytest.approx(2.0 * 8.0 * 40.0, rel=0.02)


def test_covariance_does_not_know_of_the_records_between_two_scans():
    """Eq. M34 is of the time since the last scan: in one step or in seven it comes to the same."""
    covs = []
    for count in (1, 7):
        source = constant_velocity()
        drive(source, [(0.0, pose()), (0.2, pose(0.1, 0.0, 0.0))])
        steps = [source.step(0.2 + 0.4 * (k + 1) / count, pose())[1] for k in range(count)]
        covs.append(np.sum(steps, axis=0))
        assert all(np.diag(cov).min() > 0.0 for cov in steps)
    np.testing.assert_allclose(covs[0], covs[1])


def test_forecast_is_the_best_one_of_velocities_that_change_at_random():
    """Monte Carlo: its error has the variance that it says, and nothing to do with the motion that it is made of."""
    rng = np.random.default_rng(0)
    speed, change, dt, count = 0.4, 0.5, 0.01, 4000
    kept = np.exp(-dt * change**2 / (2.0 * speed**2))
    speeds = np.empty((count, 101))
    speeds[:, 0] = speed * rng.standard_normal(count)
    for k in range(100):
        speeds[:, k + 1] = kept * speeds[:, k] + speed * np.sqrt(1.0 - kept**2) * rng.standard_normal(count)
    ways = 0.5 * dt * (speeds[:, :-1] + speeds[:, 1:])
    before, after = ways[:, :60].sum(axis=1), ways[:, 60:].sum(axis=1)

    source = ConstantVelocity(speed, 1.0, change, 1.0)
    drive(source, [(0.0, pose()), (0.6, pose(0.1, 0.0, 0.0))])
    motion, cov = source.step(1.0, pose())
    errors = after - motion[0] / 0.1 * before
    # 4000 samples know a variance to 2.2 %, a correlation to 0.016: four sigma.
    assert np.var(errors) == pytest.approx(cov[0, 0], rel=0.09)
    assert abs(np.corrcoef(errors, before)[0, 1]) < 0.064


def test_a_scan_that_tells_nothing_leaves_the_velocity_as_uncertain_as_before():
    """Of a robot of which nothing is known: the next motion is foreseen as the first one was."""
    source = constant_velocity()
    source.step(0.0, pose())
    source.learn(0.0, since_scan(pose()))
    motion, cov = source.step(0.2, pose())
    drifting = ClonedPose(pose())
    anchor = drifting.clone()
    drifting.move(motion, cov)
    source.learn(0.2, anchor)
    motion_after, cov_after = source.step(0.4, pose())
    np.testing.assert_allclose(motion_after, motion, atol=1e-12)
    np.testing.assert_allclose(cov_after, cov, rtol=1e-9)


def test_a_turn_rate_is_learned_across_the_cut_of_angles():
    """170 deg from scan to scan, then 190, which is a motion of -170 deg; all is linear, so it is twice the half."""
    turns = np.radians([170.0] * 4 + [190.0] * 4)
    forecasts = []
    for share in (0.5, 1.0):
        source = ConstantVelocity(1.0, 10.0, 1.0, 10.0)
        drive(source, [(0.0, pose()), *((k + 1.0, pose(0.0, 0.0, share * turn)) for k, turn in enumerate(turns))])
        forecasts.append(source.step(9.0, pose())[0][2])
    assert forecasts[1] == pytest.approx(2.0 * forecasts[0], abs=1e-9)


def test_two_scans_of_one_stamp_leave_the_velocity():
    records = [(0.0, pose()), (0.2, pose(0.1, 0.0, 0.0))]
    motions = []
    for more in ([], [(0.2, pose(0.001, 0.0, 0.0))]):
        source = constant_velocity()
        drive(source, records + more)
        motion, cov = source.step(0.4, pose())
        assert np.isfinite(cov).all()
        motions.append(motion)
    np.testing.assert_array_equal(*motions)


def test_stamps_in_bursts_do_not_run_away():
    """A steady robot whose scans are stamped late, in pairs a millisecond apart, stays within what is foreseen."""
    source = constant_velocity()
    stamp = 0.0
    for k in range(100):
        stamp += 0.001 if k % 2 else 0.399
        motion, cov = source.step(stamp, pose())
        if k > 20:
            error = motion - [0.06, 0.0, 0.0]
            assert error @ np.linalg.solve(cov, error) < 16.0
            assert np.abs(motion[:2]).max() < 0.5
            assert np.sqrt(cov[0, 0]) < 0.5
        source.learn(stamp, since_scan(pose(0.06, 0.0, 0.0)))


def test_a_motion_that_nothing_foresaw_leaves_the_velocity_of_a_robot():
    """Half a metre within a millisecond is a wrong stamp: later motions are foreseen as of any robot."""
    source = constant_velocity()
    drive(source, [(0.1 * k, pose(0.05, 0.0, 0.0)) for k in range(5)])
    source.step(0.401, pose())
    drifting = ClonedPose(pose())
    anchor = drifting.clone()
    drifting.move(pose(0.5, 0.0, 0.0), np.diag([0.25, 0.25, 0.1]))
    source.learn(0.401, anchor)
    motion, cov = source.step(0.501, pose())
    assert np.abs(motion[:2]).max() < 0.3
    assert np.linalg.eigvalsh(cov)[0] > 0.0
    assert np.sqrt(cov[0, 0]) < 0.3


@pytest.mark.parametrize(("sigmas", "kept"), [(2.0, True), (4.0, False), (-4.0, False)])
def test_a_velocity_that_no_robot_has_is_forgotten(sigmas, kept):
    """Beyond three sigmas of what a robot may do it is that of a wrong stamp or scan, however surely it is told."""
    speed, interval = 1.0, 0.2
    source = constant_velocity(speed)
    drive(source, [(0.0, pose()), (interval, pose(sigmas * speed * interval))])
    motion, cov = source.step(interval + 1e-4, pose())
    if kept:
        assert motion[0] > 0.5 * sigmas * speed * 1e-4
    else:
        np.testing.assert_allclose(motion, 0.0, atol=1e-12)
        assert math.sqrt(cov[0, 0]) == pytest.approx(speed * 1e-4, rel=0.05)
