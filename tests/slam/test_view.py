"""What a frame shows: corners in the robot's frame, without the motion during the scan, or landmarks as given."""

import math
from dataclasses import replace

import numpy as np
import pytest
from observed_corners import corners
from scenes import FULL_TURN, polygon

from drivers.frame import Frame, LandmarkObservations
from features.scan import LaserScan
from features.se2 import compose, inverse, pose, rotation, transform
from features.sensor import Mounting
from sim.worlds.world import World
from slam.config import SlamConfig
from slam.errors import ConfigError
from slam.key_frame import KeyFrame
from slam.result.records import Records
from slam.view import View, look

ROOM = polygon([(3.0, 2.0), (-2.5, 2.0), (-2.5, -1.8), (0.5, -1.8), (0.5, -1.0), (3.0, -1.0)])
"""A room with a corner that points into it."""

FRONT, HANGING = Mounting(0.2, -0.1, 0.6), Mounting(0.1, 0.1, -0.7, upside_down=True)
MOUNTINGS = pytest.mark.parametrize("mounting", [Mounting(), FRONT, HANGING], ids=["centre", "front", "hanging"])


def config_of(**odometry):
    config = SlamConfig.of_preset("rplidar-s1")
    return config.model_copy(update={"odometry": config.odometry.model_copy(update=odometry)})


def with_front_end(config, **front_end):
    return config.model_copy(update={"front_end": config.front_end.model_copy(update=front_end)})


def sensor_of(config, mounting):
    return replace(config.sensor.model(), mounting=mounting)


def exact(world: World, mounting, poses_world_robot, times=None):
    """A scan without noise, each beam from where the robot is at its time."""
    turned = -FULL_TURN if mounting.upside_down else FULL_TURN
    ranges = np.empty(len(FULL_TURN))
    for k, here in enumerate(np.broadcast_to(poses_world_robot, (len(FULL_TURN), 3))):
        ranges[k] = world.cast(compose(here, mounting.pose_robot_sensor), turned[k : k + 1])[0][0]
    return LaserScan(ranges, FULL_TURN, 0.0, times)


def off_walls(points, world):
    """Distance of each point from the nearest wall of the world [m]."""
    starts, along = world.walls[:, :2], world.walls[:, 2:] - world.walls[:, :2]
    arms = points[:, None] - starts
    share = np.clip((arms * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    return np.linalg.norm(arms - share[..., None] * along, axis=-1).min(axis=1)


def nearest(points, others):
    return np.linalg.norm(points[:, None] - others, axis=-1).min(axis=1)


@MOUNTINGS
def test_corners_of_a_view_and_what_is_kept_of_a_key_frame_lie_where_the_robot_sees_them(mounting):
    """Carried to the world by the robot's pose, corners are the room's, and points and walls lie on its walls."""
    config, here = config_of(), pose(-0.6, 0.2, 0.9)
    sensor = sensor_of(config, mounting)
    scan = exact(ROOM, mounting, here)
    view = look(Frame(0.0, here, scan), config, sensor, Records())
    assert view is not None
    found = transform(here, view.corners_robot.positions)
    assert len(found) == len(ROOM.corners)
    # Without noise a corner is off by what the split of its lines at a beam leaves: millimetres.
    assert nearest(found, ROOM.corners).max() < 5e-3
    key_frame = KeyFrame.of(7, view, sensor)
    assert key_frame.record == 7
    assert len(key_frame.points_robot) == len(scan)
    assert off_walls(transform(here, key_frame.points_robot), ROOM).max() < 1e-9
    assert key_frame.walls_robot.shape == (len(view.features.lines), 2, 2)
    assert off_walls(transform(here, key_frame.walls_robot.reshape(-1, 2)), ROOM).max() < 5e-3


def test_a_key_frame_keeps_the_points_within_the_limits_of_the_sensor_only():
    config = config_of()
    sensor = sensor_of(config, Mounting())
    scan = exact(ROOM, Mounting(), pose())
    none = [0.0, 0.5 * sensor.range_min, 1.5 * sensor.range_max, math.inf]
    ranges = scan.ranges.copy()
    ranges[100:104] = none
    view = look(Frame(0.0, pose(), LaserScan(ranges, scan.angles)), config, sensor, Records())
    kept = KeyFrame.of(0, view, sensor).points_robot
    np.testing.assert_allclose(np.hypot(*kept.T), np.delete(ranges, range(100, 104)), rtol=1e-12)


def test_of_landmarks_that_a_sensor_found_itself_a_key_frame_keeps_no_scan():
    config = config_of()
    sensor = config.sensor.model()
    seen = Frame(0.0, pose(), observations=LandmarkObservations(np.array([2.0]), np.array([0.5])))
    view = look(seen, config, sensor, Records())
    assert view is not None
    assert view.scan is None
    kept = KeyFrame.of(3, view, sensor)
    assert (kept.record, kept.walls_robot.shape, kept.points_robot.shape) == (3, (0, 2, 2), (0, 2))


def test_a_record_of_odometry_shows_nothing():
    config = config_of()
    assert look(Frame(0.0, pose()), config, config.sensor.model(), Records()) is None


def moving(poses_odom, poses_map):
    records = Records()
    for k, (odom, by_map) in enumerate(zip(poses_odom, poses_map, strict=True)):
        records.add(0.1 * k, odom, by_map)
    return records


@MOUNTINGS
@pytest.mark.parametrize(("source", "told"), [("line-aided", "odom"), ("wheel", "odom"), ("lines", "map")])
def test_the_motion_during_a_scan_is_undone_by_what_tells_it(mounting, source, told):
    """A robot at 0.8 m/s and 1 rad/s scans for 0.1 s; wheels tell its motion, without them the poses found so far."""
    config = config_of(source=source)
    sensor = sensor_of(config, mounting)
    velocity = np.array([0.8, 0.0, 1.0])
    poses = [velocity * 0.1 * k for k in range(3)]
    standing = [pose() for _ in poses]
    records = moving(poses, standing) if told == "odom" else moving(standing, poses)
    times = np.linspace(0.0, 0.1, len(FULL_TURN), endpoint=False) + 0.1
    scan = exact(ROOM, mounting, times[:, None] * velocity, times)
    here = poses[-1]
    view = look(Frame(0.2, records.poses_odom[-1], scan), config, sensor, records)
    assert nearest(transform(here, view.corners_robot.positions), ROOM.corners).max() < 5e-3
    as_taken = look(Frame(0.2, here, scan), with_front_end(config, deskew=False), sensor, records)
    # The corner at 3 m turns by up to 0.1 rad during the scan.
    assert nearest(transform(here, as_taken.corners_robot.positions), ROOM.corners).max() > 0.1


def observed(identities=(5, 2)):
    return Frame(
        0.0,
        pose(),
        observations=LandmarkObservations(np.array([2.0, 3.0]), np.array([0.5, -0.4]), None, np.array(identities)),
    )


@pytest.mark.parametrize("used", [True, False])
def test_identities_of_landmarks_are_taken_where_they_are_to_be(used):
    config = with_front_end(config_of(), use_identities=used)
    view = look(observed(), config, config.sensor.model(), Records())
    expected = [5, 2] if used else None
    assert (None if view.identities is None else view.identities.tolist()) == expected
    np.testing.assert_allclose(
        view.corners_robot.positions, [[2.0 * math.cos(0.5), 2.0 * math.sin(0.5)], 3.0 * rotation(-0.4)[:, 0]]
    )


def test_landmarks_that_a_sensor_found_itself_need_wheels():
    config = config_of(source="lines")
    with pytest.raises(ConfigError, match=r"odometry\.source is 'lines'.*expected 'line-aided' or 'wheel'"):
        look(observed(), config, config.sensor.model(), Records())


def test_observations_are_the_corners_that_are_of_a_landmark_with_the_scatter_of_real_ones():
    seen = corners([[1.0, 0.0], [0.0, 2.0], [3.0, 1.0]])
    observations = View(seen).observations(np.array([4, -1, 0]), 0.02)
    assert observations.landmarks.tolist() == [4, 0]
    np.testing.assert_array_equal(observations.positions_robot, seen.positions[[0, 2]])
    np.testing.assert_allclose(observations.covs, seen.covs[[0, 2]] + 0.02**2 * np.eye(2), rtol=1e-12)


def test_the_robot_frame_is_that_of_the_pose():
    """The same room from two poses gives corners that differ by the motion between them."""
    config = config_of()
    sensor = sensor_of(config, FRONT)
    one, other = pose(-0.6, 0.2, 0.9), pose(-0.4, 0.1, -2.0)
    views = [look(Frame(0.0, here, exact(ROOM, FRONT, here)), config, sensor, Records()) for here in (one, other)]
    motion = compose(inverse(one), other)
    carried = transform(motion, views[1].corners_robot.positions)
    assert nearest(carried, views[0].corners_robot.positions).max() < 1e-2
