"""Motion during a scan, undone: exactly for exact beams, and as well as the odometry is for a run."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import polygon

from drivers.frame import Frame
from features import LaserScan, extract, sensor_preset
from features.se2 import compose, pose, transform, wrap_angle
from features.sensor import Mounting
from sim import Effects, Lidar, Robot, SimulatedRun, WheelOdometry, label_corners, room
from slam.config import SlamConfig
from slam.evaluation.metrics import ate
from slam.odometry.deskew import (
    Sweep,
    carry_beams,
    deskew,
    doubt_corners,
    doubt_pose,
    doubt_walls,
    poses_at,
    walls_by_velocity,
)
from slam.odometry.line_map import (
    CENTER,
    NORMAL_X,
    NORMAL_Y,
    VAR_ANGLE,
    VAR_OFFSET,
    WALL_X,
    WALL_Y,
    walls_of_lines,
)
from slam.pipeline import Slam
from slam.result.trajectory import Trajectory

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
    scan = carry_beams(skewed, model, place, poses)
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
    still = carry_beams(scan, model, pose(0.0, 0.0, 0.4), poses)
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
            "corrected": (carry_beams(turning.scan, model, place, poses), turning.wall_ids),
            "skewed": (turning.scan, turning.wall_ids),
        }
        found = {name: corner_errors(scan, place, model, truth) for name, (scan, truth) in scans.items()}
        both = found["at rest"].keys() & found["corrected"].keys()
        for name, labels in (("at rest", both), ("corrected", both), ("skewed", found["skewed"].keys())):
            errors[name].extend(found[name][label] for label in sorted(labels))
    assert len(errors["at rest"]) > 1500
    assert abs(rms(errors["corrected"]) / rms(errors["at rest"]) - 1.0) < 0.1
    assert rms(errors["skewed"]) > 4.0 * rms(errors["at rest"])


@pytest.mark.parametrize("begin", [0.0, -0.1, -0.05])
def test_records_are_followed_and_gone_beyond(begin):
    """Times after, before and around the last record, of a steady motion over the cut of angles."""
    stamps = np.arange(-10, 1) * 0.02
    times = begin + np.linspace(0.0, 0.1, 50)

    def at(time):
        return np.column_stack([1.0 + 0.5 * time, 2.0 - 0.2 * time, wrap_angle(3.2 + 1.0 * time)])

    found = poses_at(times, stamps.tolist(), list(at(stamps)), 0.1)
    np.testing.assert_allclose(found[:, :2], at(times)[:, :2], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(wrap_angle(found[:, 2] - at(times)[:, 2]), 0.0, atol=1e-9)


def test_before_and_beyond_a_single_record_the_robot_is_there():
    times = np.linspace(1.9, 2.1, 5)
    np.testing.assert_array_equal(poses_at(times, [2.0], [pose(1.0, 2.0, 3.0)], 0.2), np.tile([1.0, 2.0, 3.0], (5, 1)))


def test_records_almost_at_once_tell_no_velocity():
    """A micrometre within a nanosecond is no kilometre per second; a longer time before tells the velocity."""
    places = [pose(0.0), pose(0.1), pose(0.1 + 1e-6)]
    found = poses_at(np.array([1.05]), [0.9, 1.0, 1.0 + 1e-9], places, 0.1)
    np.testing.assert_allclose(found, [[0.15, 0.0, 0.0]], atol=1e-5)
    np.testing.assert_array_equal(poses_at(np.array([1.05]), [1.0, 1.0 + 1e-9], places[1:], 0.1), [places[2]])


ARC_TIMES = np.linspace(-0.05, 0.05, 900)


def sweep_of(velocity_cov, velocity=(0.0, 0.0, 0.0)):
    return Sweep(0.0, pose(), ARC_TIMES, ARC_TIMES[:, None] * np.array(velocity), np.array(velocity_cov))


MOUNTINGS = pytest.mark.parametrize(
    "mounting", [Mounting(), Mounting(0.2, -0.1, 0.6), Mounting(0.1, 0.1, -0.7, upside_down=True)]
)


BOX = polygon([(3.0, 2.0), (-2.5, 2.0), (-2.5, -1.8), (3.0, -1.8)])


def scan_of(mounting, sweep):
    """A scan without noise from the middle of the room that is de-skewed with a wrong motion."""
    model = dataclasses.replace(sensor_preset("rplidar-s1"), mounting=mounting)
    angles = np.linspace(-math.pi, math.pi, ARC_TIMES.size, endpoint=False)
    place = compose(pose(0.3, 0.2, 0.4), mounting.pose_robot_sensor)
    scan = LaserScan(BOX.cast(place, angles)[0], angles, 0.0, ARC_TIMES)
    return deskew(scan, model, sweep), model


ERROR = np.array([0.02, -0.03, 0.05])
"""Of a velocity [m/s, m/s, rad/s], small enough for what it moves to be in proportion to it."""


@MOUNTINGS
def test_corners_are_doubted_by_the_motion_between_the_middle_of_the_sweep_and_their_beams(mounting):
    """A corner moves with the robot, and with its arm where the robot turns; in the middle of the sweep it does not."""
    scan, model = scan_of(mounting, sweep_of(np.zeros((3, 3))))
    corners = extract(scan, model).corners.to_robot(mounting)
    doubted = doubt_corners(corners, scan, mounting, sweep_of(np.outer(ERROR, ERROR)))
    assert len(corners) > 3
    for here, cov in zip(corners.positions, doubted.covs - corners.covs, strict=True):
        x, y = mounting.points_to_sensor(here)
        time = np.interp(math.atan2(y, x), scan.angles, ARC_TIMES)
        shift = time * (ERROR[:2] + ERROR[2] * np.array([-here[1], here[0]]))
        np.testing.assert_allclose(cov, np.outer(shift, shift), rtol=0.1, atol=1e-8)


@MOUNTINGS
def test_walls_and_pose_are_doubted_by_as_much_as_a_wrong_velocity_moves_them(mounting):
    exact, model = scan_of(mounting, sweep_of(np.zeros((3, 3))))
    wrong, _ = scan_of(mounting, sweep_of(np.zeros((3, 3)), ERROR))
    lines, moved = extract(exact, model).lines, extract(wrong, model).lines
    walls, walls_moved = walls_of_lines(lines, mounting), walls_of_lines(moved, mounting)
    assert len(walls) == len(walls_moved) > 3
    sweep = sweep_of(np.outer(ERROR, ERROR))
    by_velocity = walls_by_velocity(walls, lines, exact, mounting, sweep)
    normals, others = walls[:, [NORMAL_X, NORMAL_Y]], walls_moved[:, [NORMAL_X, NORMAL_Y]]
    turned = normals[:, 0] * others[:, 1] - normals[:, 1] * others[:, 0]
    along = np.column_stack([normals[:, 1], -normals[:, 0]])
    pivots = walls[:, [WALL_X, WALL_Y]] + walls[:, CENTER, None] * along
    offsets = (others * (walls_moved[:, [WALL_X, WALL_Y]] - pivots)).sum(axis=1)
    # The seam of the scan, where the last beam meets the first, is a step in a wall.
    within = np.ptp(sweep.times[lines.beams], axis=1) < 0.05
    assert within.sum() > 2
    expected = by_velocity @ ERROR
    np.testing.assert_allclose(offsets[within], expected[within, 0], atol=4e-4)
    np.testing.assert_allclose(turned[within], expected[within, 1], atol=1.5e-3)
    doubted = doubt_walls(walls, by_velocity, sweep)
    np.testing.assert_allclose(doubted[:, VAR_OFFSET] - walls[:, VAR_OFFSET], expected[:, 0] ** 2, atol=1e-12)
    np.testing.assert_allclose(doubted[:, VAR_ANGLE] - walls[:, VAR_ANGLE], expected[:, 1] ** 2, atol=1e-12)
    cov = doubt_pose(walls, by_velocity, sweep, np.eye(3))
    assert np.linalg.matrix_rank(cov, tol=1e-12) == 1
    # The pose in which moved walls fit those that were not, by least squares.
    by_pose = np.zeros((len(walls), 2, 3))
    by_pose[:, 0, :2], by_pose[:, 1, 2] = normals, 1.0
    by_pose[:, 0, 2] = (along * pivots).sum(axis=1)
    root = 1.0 / np.sqrt(walls[:, [VAR_OFFSET, VAR_ANGLE], None])
    system = np.vstack([(root * by_pose).reshape(-1, 3), np.eye(3)])
    shifts = np.append((root[..., 0] * expected).ravel(), np.zeros(3))
    shift = np.linalg.lstsq(system, shifts, rcond=None)[0]
    np.testing.assert_allclose(cov, np.outer(shift, shift), rtol=1e-6, atol=1e-12)


def without_wheels(scanner, later, *, backwards=False):
    """Largest error [m, rad] without wheels, and how many predictions were rejected, of a drive along a curve."""
    trajectory = Robot(speed=0.6, turn_rate=1.0).drive(
        [(2.2, 1.7), (4.8, 1.5), (7.4, 1.8), (8.1, 3.6), (7.7, 5.4)], 50.0
    )
    run = SimulatedRun("sweep", room(), scanner, "rplidar-s1", trajectory, WheelOdometry(), 1)
    config = SlamConfig.of_preset("rplidar-s1")
    slam = Slam(config.model_copy(update={"odometry": config.odometry.model_copy(update={"source": "lines"})}))
    scans = [frame.scan for frame in run if frame.scan is not None]
    end = scans[-1].stamp
    errors = []
    for scan in scans[::-1] if backwards else scans:
        # The first beam of the turned time is the last one of the drive; its time counts from there.
        times = -scan.times if backwards else scan.times
        stamp = end - scan.stamp if backwards else scan.stamp
        first = float(times.min()) if later else 0.0
        turned = dataclasses.replace(scan, stamp=stamp + first, times=times - first)
        step = slam.process(Frame(stamp + first, pose(), turned))
        errors.append((step.stamp, step.pose_world_robot))
    stamps, poses = np.array([stamp for stamp, _ in errors]), np.array([place for _, place in errors])
    truth = trajectory.at(end - stamps if backwards else stamps)
    off = ate(Trajectory(stamps, truth), Trajectory(stamps, poses))
    return off.rmse_m, slam.finish().metrics.registrations.predictions_rejected


@pytest.mark.slow
@pytest.mark.parametrize("later", [False, True], ids=["stamp of the last beam", "stamp of the first beam"])
@pytest.mark.parametrize("backwards", [False, True], ids=["forwards", "backwards"])
@pytest.mark.parametrize("degrees", [360, 270])
def test_without_wheels_the_velocity_does_not_feed_on_itself(later, backwards, degrees):
    """Carried to its first beam with the velocity learned from the poses so found, the error oscillates and grows."""
    scanner = Lidar.of_preset("rplidar-s1", effects=SWEEP)
    kept = np.abs(scanner.angles) <= math.radians(degrees / 2.0)
    scanner = dataclasses.replace(scanner, angles=scanner.angles[kept])
    error, rejected = without_wheels(scanner, later, backwards=backwards)
    assert error < 0.02
    assert rejected == 0


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
    for frame in run:
        step = slam.process(frame)
        truth = trajectory.at(np.array([step.stamp]))[0]
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
    still = carry_beams(scan, model, pose(), np.array([[0.0, 0.0, math.pi / 2.0]]))
    expected = compose(pose(0.0, 0.0, math.pi / 2.0), pose(3.0))[:2] - [1.0, 0.0]
    np.testing.assert_allclose(points(still)[0], expected, rtol=0.0, atol=1e-12)
