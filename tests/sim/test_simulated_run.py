"""A simulated run: a source of frames like any other, and the truth beside it."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.frame import Frame, FrameSource
from features.sensor import Mounting
from sim import (
    EFFECTS,
    AlphaOdometry,
    Effects,
    Lidar,
    OmniRobot,
    Person,
    Robot,
    SimulatedRun,
    TrueTrajectory,
    WheelOdometry,
    room,
    room_run,
)

SEEDS = range(30)


def short_run(seed=0, preset="rplidar-s1", rate=20.0, mounting=None):
    trajectory = Robot().drive([(2.2, 1.7), (3.5, 1.7)], rate)
    odometry = WheelOdometry(sigma_turn_per_metre=0.02, sigma_distance_per_metre=0.02)
    return SimulatedRun("short", room(), Lidar.of_preset(preset, mounting), preset, trajectory, odometry, seed)


def content(source):
    """Everything that the frames of a source hold, as bytes."""
    frames = [(f.stamp, f.pose_odom_robot.tobytes(), f.scan) for f in source]
    return [(t, pose, None if scan is None else (scan.stamp, scan.ranges.tobytes())) for t, pose, scan in frames]


def absolute_trajectory_error(truth, estimate):
    """RMSE [m] of positions, shape (n, 2), after the best rigid alignment (Kabsch)."""
    truth, estimate = truth - truth.mean(axis=0), estimate - estimate.mean(axis=0)
    u, _, vt = np.linalg.svd(estimate.T @ truth)
    rotation = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
    return np.sqrt(((estimate @ rotation - truth) ** 2).sum(axis=1).mean())


@pytest.fixture(scope="module")
def room_runs():
    return [room_run(seed) for seed in SEEDS]


def test_frames_have_the_stamps_and_odometry_of_the_run():
    source: FrameSource = short_run()
    frames = list(source)
    assert all(isinstance(frame, Frame) for frame in frames)
    run = short_run()
    assert [frame.stamp for frame in frames] == run.stamps.tolist()
    np.testing.assert_array_equal([frame.pose_odom_robot for frame in frames], run.poses_odom_robot)
    assert run.poses_world_robot.shape == (len(run), 3)
    assert (np.diff(run.stamps) > 0.0).all()


@pytest.mark.parametrize(("preset", "every"), [("rplidar-s1", 2), ("sick-lms", 4)])
def test_scans_come_at_the_rate_of_the_lidar(preset, every):
    """Odometry comes at 20 Hz, the first frame has a scan, and a scan has the stamp of its frame."""
    run = short_run(preset=preset)
    frames = list(run)
    assert [frame.scan is not None for frame in frames] == [k % every == 0 for k in range(len(run))]
    assert [frame.scan is not None for frame in frames] == run.has_scan.tolist()
    assert all(frame.scan.stamp == frame.stamp for frame in frames if frame.scan is not None)


def test_says_what_it_is():
    mounting = Mounting(x=0.1, upside_down=True)
    run = room_run(3, preset="sick-lms", mounting=mounting)
    assert (run.name, run.sensor, run.mounting) == ("room-3", "sick-lms", mounting)


def test_scans_are_taken_from_the_true_pose():
    """Ranges differ from those of an ideal lidar there by the lidar's noise, not by the error of the odometry."""
    run = short_run()
    ideal = Lidar(run.lidar.angles, 0.0, 0.0, 0.0, 100.0, 10.0)
    last = int(np.flatnonzero(run.has_scan)[-1])
    scan = list(run)[last].scan
    assert scan is not None
    expected = ideal.scan(run.world, run.poses_world_robot[last], 0.0, np.random.default_rng(0))
    # The median passes over beams that noise moves across an edge; it is 0.67 sigma_range, and a little of the bearing.
    assert 0.5 * run.lidar.sigma_range < np.median(abs(scan.ranges - expected.ranges)) < run.lidar.sigma_range


def test_odometry_starts_at_the_true_first_pose():
    run = room_run(0)
    np.testing.assert_allclose(run.poses_odom_robot[0], run.poses_world_robot[0], rtol=0.0, atol=1e-12)


def test_same_seed_gives_the_same_bytes_on_each_iteration_too():
    run = short_run(seed=1)
    first = content(run)
    assert first == content(run)
    assert first == content(short_run(seed=1))
    assert first != content(short_run(seed=2))


def test_interleaved_iterations_do_not_disturb_each_other():
    run = short_run()
    expected = content(run)
    pairs = list(zip(run, run, strict=True))
    assert content(a for a, _ in pairs) == expected
    assert content(b for _, b in pairs) == expected


def test_frames_do_not_share_memory_with_the_run():
    run = short_run()
    next(iter(run)).pose_odom_robot[:] = 99.0
    assert run.poses_odom_robot[0, 0] != 99.0


def test_progress_goes_from_zero_to_one():
    run = short_run()
    assert run.progress == 0.0
    shares = [run.progress for _ in run]
    assert shares == [k / len(run) for k in range(1, len(run) + 1)]


def test_scans_must_fall_on_odometry_records():
    with pytest.raises(ValueError, match="25 Hz, lidar at 10 Hz"):
        short_run(rate=25.0)
    with pytest.raises(ValueError, match="4 Hz, lidar at 10 Hz"):
        short_run(rate=4.0)


@pytest.mark.slow
def test_odometry_of_the_room_is_poor_for_any_seed(room_runs):
    """By itself it misses the truth by more than half a metre, after the best alignment; and seeds differ."""
    errors = [absolute_trajectory_error(run.poses_world_robot[:, :2], run.poses_odom_robot[:, :2]) for run in room_runs]
    assert min(errors) > 0.5
    assert max(errors) < 1.5
    assert len(set(errors)) == len(errors)


@pytest.mark.slow
def test_odometry_of_the_room_is_good_from_scan_to_scan(room_runs):
    """Within 0.1 s: 15 mm and 1.5 deg at most, which is 5 standard deviations of its noise beside 3 % of scale."""
    for run in room_runs:
        truth, odom = run.poses_world_robot[run.has_scan], run.poses_odom_robot[run.has_scan]
        ways = [np.hypot(*np.diff(poses[:, :2], axis=0).T) for poses in (truth, odom)]
        turns = np.diff(odom[:, 2]) - np.diff(truth[:, 2])
        assert abs(ways[1] - ways[0]).max() < 0.015
        assert abs((turns + np.pi) % (2.0 * np.pi) - np.pi).max() < np.radians(1.5)


def test_room_run_lasts_as_long_as_a_person_waits():
    run = room_run(0)
    assert 60.0 < run.stamps[-1] < 90.0
    assert len(run) == pytest.approx(50.0 * run.stamps[-1] + 1.0)


def test_a_sweep_is_cast_along_the_true_motion():
    """While driving at 0.5 m/s, each beam is taken from where the robot was at its time."""
    effects = Effects(sweep_time=0.1)
    trajectory = Robot().drive([(2.2, 1.7), (4.5, 1.7)], 50.0)
    scanner = dataclasses.replace(Lidar.of_preset("ideal"), effects=effects)
    run = SimulatedRun("sweep", room(), scanner, "rplidar-s1", trajectory, WheelOdometry(), 0)
    index = int(np.flatnonzero(run.has_scan)[20])
    scan = list(run)[index].scan
    assert scan is not None
    assert scan.times is not None
    poses = trajectory.at(scan.stamp + scan.times)
    assert np.hypot(*(poses[-1] - poses[0])[:2]) > 0.04
    np.testing.assert_array_equal(scan.ranges, room().cast_beams(poses, scan.angles)[0])
    np.testing.assert_allclose(poses[-1], run.poses_world_robot[index], rtol=0.0, atol=1e-12)


def test_before_the_first_pose_the_robot_stood():
    trajectory = Robot().drive([(2.2, 1.7), (4.5, 1.7)], 50.0)
    poses = trajectory.at(np.array([-1.0, 0.0, 0.01, 1e3]))
    first, second, last = trajectory.poses_world_robot[[0, 1, -1]]
    np.testing.assert_allclose(poses, [first, first, (first + second) / 2.0, last], rtol=0.0, atol=1e-12)


def test_headings_are_interpolated_the_short_way_round():
    trajectory = TrueTrajectory(1.0, np.array([[0.0, 0.0, 3.1], [0.0, 0.0, -3.1]]))
    assert abs(trajectory.at(np.array([0.5]))[0, 2]) == pytest.approx(np.pi)


@pytest.mark.slow
@given(st.lists(st.floats(-5.0, 70.0), max_size=6))
def test_poses_at_times_are_those_between_all_poses(times):
    """Against interpolation over the whole drive, which turns several times."""
    trajectory = Robot().drive([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0), (2.0, 0.0)], 20.0)
    x, y, headings = trajectory.poses_world_robot.T
    expected = [np.interp(times, trajectory.stamps, column) for column in (x, y, np.unwrap(headings))]
    found = trajectory.at(np.array(times))
    np.testing.assert_allclose(found[:, :2], np.column_stack(expected[:2]), atol=1e-9)
    np.testing.assert_allclose(np.exp(1j * found[:, 2]), np.exp(1j * expected[2]), atol=1e-9)


def test_measurements_are_the_scans_of_the_frames_with_their_truth():
    run = short_run()
    scans = [frame.scan for frame in run if frame.scan is not None]
    measurements = list(run.measurements())
    assert len(measurements) == len(scans)
    for scan, found in zip(scans, measurements, strict=True):
        np.testing.assert_array_equal(scan.ranges, found.scan.ranges)
        assert (found.wall_ids >= 0).all()


def test_people_of_a_run_are_seen():
    person = Person([(3.0, 1.0), (3.0, 2.5)])
    trajectory = Robot().drive([(2.2, 1.7), (3.5, 1.7)], 20.0)
    run = SimulatedRun("busy", room(), Lidar.of_preset("ideal"), "rplidar-s1", trajectory, WheelOdometry(), 0, [person])
    assert all((found.person_ids == 0).sum() > 20 for found in itertools.islice(run.measurements(), 5))


def test_room_run_takes_effects():
    run = room_run(1, effects=EFFECTS["rplidar-s1"])
    found = next(run.measurements())
    assert found.scan.times is not None
    assert run.lidar.effects == EFFECTS["rplidar-s1"]


def test_a_run_takes_any_robot_and_any_odometry():
    trajectory = OmniRobot().drive([(2.2, 1.7, 0.0), (3.5, 1.7, 1.5)], 20.0)
    odometry = AlphaOdometry(0.01, 0.01, 0.01, 0.01, omnidirectional=True)
    run = SimulatedRun("omni", room(), Lidar.of_preset("rplidar-s1"), "rplidar-s1", trajectory, odometry, 0)
    assert content(run) == content(run)
    assert run.poses_world_robot[-1, 2] > 1.0
    assert absolute_trajectory_error(run.poses_world_robot[:, :2], run.poses_odom_robot[:, :2]) > 1e-4
