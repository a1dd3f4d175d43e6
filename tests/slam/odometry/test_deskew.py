"""Motion during a scan, undone: exactly for exact beams, and as well as the odometry is for a run."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from features import LaserScan, extract, sensor_preset
from features.se2 import compose, pose, transform, wrap_angle
from features.sensor import Mounting
from sim import Effects, Lidar, Robot, SimulatedRun, WheelOdometry, label_corners, room
from slam.config import SlamConfig
from slam.odometry.deskew import deskew, deskew_by_odometry
from slam.pipeline import Slam

ROOM = room()
SWEEP = Effects(sweep_time=0.1)
SPEED, TURN_RATE = 0.5, 1.0


def motion(place, times, speed, turn_rate):
    """Poses on an arc that is at ``place`` at time 0, shape (n, 3)."""
    headings = place[2] + turn_rate * times
    middles = place[2] + turn_rate * times / 2.0
    way = speed * times * np.sinc(turn_rate * times / (2.0 * np.pi))
    return np.column_stack([place[0] + way * np.cos(middles), place[1] + way * np.sin(middles), wrap_angle(headings)])


@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.floats(-1.0, 1.0),
    turn_rate=st.floats(-3.0, 3.0),
    upside_down=st.booleans(),
)
@settings(derandomize=True, deadline=None, max_examples=60)
def test_beams_end_where_they_ended(seed, speed, turn_rate, upside_down):
    """Beams without noise, of any motion and mounting: each point lies where the beam hit, seen from the one pose."""
    rng = np.random.default_rng(seed)
    mounting = Mounting(*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3.0, 3.0), upside_down)
    scanner = Lidar.of_preset("ideal", mounting, SWEEP)
    scanner = dataclasses.replace(scanner, angles=scanner.angles[::20])
    model = dataclasses.replace(sensor_preset("rplidar-s1"), mounting=mounting)
    place = pose(*rng.uniform([1.5, 1.5, -3.0], [2.5, 2.5, 3.0]))
    poses = motion(place, scanner.times, speed, turn_rate)
    skewed = scanner.measure(ROOM, poses, 5.0, rng).scan
    scan = deskew(skewed, model, place, poses)
    for here, beam_pose, before, after in zip(
        itertools.repeat(place), poses, points(skewed), points(scan), strict=False
    ):
        hit = transform(beam_pose, mounting.points_to_robot(before))
        np.testing.assert_allclose(transform(here, mounting.points_to_robot(after)), hit, rtol=0.0, atol=1e-9)
    assert scan.times is None
    assert scan.stamp == 5.0


def points(scan):
    return scan.ranges[:, None] * np.column_stack([np.cos(scan.angles), np.sin(scan.angles)])


@pytest.mark.parametrize("upside_down", [False, True])
def test_beams_without_return_turn_with_the_robot(upside_down):
    """Zero, infinite and beyond the limit: the range stays, the direction in the world too."""
    model = dataclasses.replace(sensor_preset("rplidar-s1"), mounting=Mounting(0.1, 0.2, 0.5, upside_down))
    scan = LaserScan([0.0, np.inf, 45.0, 0.05], [0.0, 1.0, -2.0, 3.0], 0.0, [-0.3, -0.2, -0.1, 0.0])
    poses = np.column_stack([np.zeros(4), np.zeros(4), [0.1, 0.2, 0.3, 0.4]])
    still = deskew(scan, model, pose(0.0, 0.0, 0.4), poses)
    np.testing.assert_array_equal(still.ranges, scan.ranges)
    expected = scan.angles + (-1.0 if upside_down else 1.0) * np.array([-0.3, -0.2, -0.1, 0.0])
    np.testing.assert_allclose(still.angles, expected, rtol=0.0, atol=1e-12)


def corner_errors(measured, place, model, truth):
    """Error [m], shape (2,), of each corner that a scan shows, by its number in the room."""
    corners = extract(measured, model).corners
    positions = transform(place, corners.positions)
    labels = label_corners(ROOM, truth, positions, 0.3)
    return {
        label: position - ROOM.corners[label] for label, position in zip(labels, positions, strict=True) if label >= 0
    }


def rms(errors):
    return math.sqrt(np.mean(np.concatenate(errors) ** 2))


@pytest.mark.parametrize("speed", [0.0, SPEED])
def test_corners_are_as_accurate_as_standing_still(speed):
    """Turning at 1 rad/s, on the spot and driving, with the true motion: within 10 %; without it, far from it.

    300 scans show some 3000 corners each way; the standard error of either RMS is about 1 % of it.
    """
    model, rng = sensor_preset("rplidar-s1"), np.random.default_rng(0)
    at_rest, sweeping = Lidar.of_preset("rplidar-s1"), Lidar.of_preset("rplidar-s1", effects=SWEEP)
    errors = {"at rest": [], "corrected": [], "skewed": []}
    for _ in range(300):
        place = pose(*rng.uniform([1.5, 1.5, -3.0], [8.0, 2.5, 3.0]))
        poses = motion(place, sweeping.times, speed, TURN_RATE)
        still = at_rest.measure(ROOM, place, 0.0, rng)
        turning = sweeping.measure(ROOM, poses, 0.0, rng)
        scans = {
            "at rest": (still.scan, still.wall_ids),
            "corrected": (deskew(turning.scan, model, place, poses), turning.wall_ids),
            "skewed": (turning.scan, turning.wall_ids),
        }
        found = {name: corner_errors(scan, place, model, truth) for name, (scan, truth) in scans.items()}
        both = found["at rest"].keys() & found["corrected"].keys()
        for name, labels in (("at rest", both), ("corrected", both), ("skewed", found["skewed"].keys())):
            errors[name].extend(found[name][label] for label in sorted(labels))
    assert len(errors["at rest"]) > 1500
    assert abs(rms(errors["corrected"]) / rms(errors["at rest"]) - 1.0) < 0.1
    assert rms(errors["skewed"]) > 4.0 * rms(errors["at rest"])


@pytest.mark.parametrize("scan_stamp", [0.0, -0.1, -0.05])
def test_odometry_is_followed_between_records_and_beyond_the_last(scan_stamp):
    """Beams after, before and around the last record, from records of steady motion over the cut of angles."""
    stamps = np.arange(-10, 1) * 0.02
    poses = np.column_stack([1.0 + 0.5 * stamps, 2.0 - 0.2 * stamps, wrap_angle(3.2 + 1.0 * stamps)])
    model = sensor_preset("rplidar-s1")
    scan = LaserScan(np.full(50, 3.0), np.linspace(-3.0, 3.0, 50), scan_stamp, np.linspace(0.0, 0.1, 50))
    times = scan_stamp + np.linspace(0.0, 0.1, 50)
    truth = np.column_stack([1.0 + 0.5 * times, 2.0 - 0.2 * times, wrap_angle(3.2 + 1.0 * times)])
    expected = deskew(scan, model, poses[-1], truth)
    found = deskew_by_odometry(scan, model, stamps.tolist(), list(poses))
    np.testing.assert_allclose(points(found), points(expected), rtol=0.0, atol=1e-9)


def test_a_scan_at_the_first_record_is_that_of_a_robot_at_rest():
    scan = LaserScan(np.full(5, 3.0), np.linspace(-1.0, 1.0, 5), 2.0, np.linspace(-0.1, 0.1, 5))
    found = deskew_by_odometry(scan, sensor_preset("rplidar-s1"), [2.0], [pose(1.0, 2.0, 3.0)])
    np.testing.assert_allclose(points(found), points(scan), rtol=0.0, atol=1e-12)


def test_records_of_the_same_stamp_have_no_speed_between_them():
    """The velocity after the last record is that from the last one of an earlier stamp."""
    scan = LaserScan(np.full(5, 3.0), np.linspace(-1.0, 1.0, 5), 1.0, np.linspace(0.0, 0.1, 5))
    poses = [pose(0.0), pose(0.1), pose(0.1)]
    found = deskew_by_odometry(scan, sensor_preset("rplidar-s1"), [0.9, 1.0, 1.0], poses)
    expected = points(scan) + np.linspace(0.0, 0.1, 5)[:, None] * [1.0, 0.0]
    np.testing.assert_allclose(points(found), expected, rtol=0.0, atol=1e-9)


def test_a_scan_without_times_is_left_alone():
    scan = LaserScan(np.full(5, 3.0), np.linspace(-1.0, 1.0, 5), 1.0)
    assert deskew_by_odometry(scan, sensor_preset("rplidar-s1"), [0.0], [pose()]) is scan


def trajectory_error(deskewed):
    """Largest error [m] of the filter along a drive with a scanner that sweeps; odometry as good as the truth."""
    trajectory = Robot(speed=1.0, turn_rate=1.5).drive(
        [(2.2, 1.7), (4.8, 1.5), (7.4, 1.8), (8.1, 3.6), (7.7, 5.4)], 50.0
    )
    scanner = Lidar.of_preset("rplidar-s1", effects=SWEEP)
    odometry = WheelOdometry(sigma_turn_per_metre=0.01, sigma_distance_per_metre=0.01)
    run = SimulatedRun("sweep", room(), scanner, "rplidar-s1", trajectory, odometry, 1)
    config = SlamConfig.of_preset("rplidar-s1")
    slam = Slam(config.model_copy(update={"front_end": config.front_end.model_copy(update={"deskew": deskewed})}))
    errors = []
    for frame, truth in zip(run, run.poses_world_robot, strict=True):
        step = slam.process(frame)
        errors.append(np.hypot(*(step.pose_world_robot - truth)[:2]))
    return max(errors)


@pytest.mark.slow
def test_the_pipeline_deskews_by_default():
    """At 1 m/s a scan is 0.1 m long: left as it is, it pulls the filter off by a multiple of what remains otherwise."""
    assert SlamConfig.of_preset("rplidar-s1").front_end.deskew
    assert trajectory_error(deskewed=True) < 0.5 * trajectory_error(deskewed=False)


def test_the_mounting_is_where_the_sensor_turns_about():
    """A sensor ahead of the centre of a turning robot moves sideways."""
    mounting = Mounting(x=1.0)
    model = dataclasses.replace(sensor_preset("rplidar-s1"), mounting=mounting)
    scan = LaserScan([2.0], [0.0], 0.0, [0.0])
    still = deskew(scan, model, pose(), np.array([[0.0, 0.0, math.pi / 2.0]]))
    expected = compose(pose(0.0, 0.0, math.pi / 2.0), pose(3.0))[:2] - [1.0, 0.0]
    np.testing.assert_allclose(points(still)[0], expected, rtol=0.0, atol=1e-12)
