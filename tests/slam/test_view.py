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
from slam.parts import CwlfExtractor
from slam.pipeline import Slam
from slam.view import View, view_of_observations, view_of_scan

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
    view = view_of_scan(scan, sensor, CwlfExtractor(config.extraction))
    found = transform(here, view.corners_robot.positions)
    assert len(found) == len(ROOM.corners)
    # Without noise a corner is off by what the split of its lines at a beam leaves: millimetres.
    assert nearest(found, ROOM.corners).max() < 5e-3
    key_frame = KeyFrame.of(7, view, sensor)
    assert key_frame.scan == 7
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
    view = view_of_scan(LaserScan(ranges, scan.angles), sensor, CwlfExtractor(config.extraction))
    kept = KeyFrame.of(0, view, sensor).points_robot
    np.testing.assert_allclose(np.hypot(*kept.T), np.delete(ranges, range(100, 104)), rtol=1e-12)


def test_of_landmarks_that_a_sensor_found_itself_a_key_frame_keeps_no_scan():
    config = config_of()
    sensor = config.sensor.model()
    seen = LandmarkObservations(np.array([2.0]), np.array([0.5]))
    view = view_of_observations(seen, sensor, use_identities=True)
    assert view.scan is None
    kept = KeyFrame.of(3, view, sensor)
    assert (kept.scan, kept.walls_robot.shape, kept.points_robot.shape) == (3, (0, 2, 2), (0, 2))


def test_a_record_of_odometry_shows_nothing():
    step = Slam(config_of()).process(Frame(0.0, pose()))
    assert (step.features, step.association) == (None, None)


VELOCITY = np.array([0.8, 0.0, 1.0])
"""Of a robot that scans for 0.1 s [m/s, m/s, rad/s]: the corner at 3 m turns by up to 0.1 rad during the scan."""


@MOUNTINGS
@pytest.mark.parametrize("deskew", [True, False])
def test_the_motion_that_the_wheels_tell_is_undone_where_it_is_asked_for(mounting, deskew):
    config = with_front_end(config_of(source="wheel"), deskew=deskew)
    config = config.model_copy(update={"sensor": config.sensor.of_preset("rplidar-s1", mounting)})
    slam = Slam(config)
    times = np.linspace(0.0, 0.1, len(FULL_TURN), endpoint=False) + 0.1
    scan = exact(ROOM, mounting, times[:, None] * VELOCITY, times)
    for k in range(2):
        slam.process(Frame(0.1 * k, 0.1 * k * VELOCITY))
    step = slam.process(Frame(0.2, 0.2 * VELOCITY, scan))
    here = step.stamp * VELOCITY
    found = transform(here, step.features.corners.to_robot(mounting).positions)
    off = nearest(found, ROOM.corners).max()
    assert off < 5e-3 if deskew else off > 0.1


def observed(identities=(5, 2)):
    return LandmarkObservations(np.array([2.0, 3.0]), np.array([0.5, -0.4]), None, np.array(identities))


@pytest.mark.parametrize("used", [True, False])
def test_identities_of_landmarks_are_taken_where_they_are_to_be(used):
    view = view_of_observations(observed(), config_of().sensor.model(), use_identities=used)
    expected = [5, 2] if used else None
    assert (None if view.identities is None else view.identities.tolist()) == expected
    np.testing.assert_allclose(
        view.corners_robot.positions, [[2.0 * math.cos(0.5), 2.0 * math.sin(0.5)], 3.0 * rotation(-0.4)[:, 0]]
    )


def test_landmarks_that_a_sensor_found_itself_need_wheels():
    slam = Slam(config_of(source="lines"))
    with pytest.raises(ConfigError, match=r"odometry\.source is 'lines'.*expected 'line-aided' or 'wheel'"):
        slam.process(Frame(0.0, pose(), observations=observed()))


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
    extractor = CwlfExtractor(config.extraction)
    views = [view_of_scan(exact(ROOM, FRONT, here), sensor, extractor) for here in (one, other)]
    motion = compose(inverse(one), other)
    carried = transform(motion, views[1].corners_robot.positions)
    assert nearest(carried, views[0].corners_robot.positions).max() < 1e-2


def last_corners(config, told):
    """Corners of the last scan of a robot at 0.8 m/s and 1 rad/s that scans for 0.1 s, in the world of its truth.

    ``told`` : what the wheels tell of a true pose.
    """
    slam, velocity, mounting = Slam(config), VELOCITY, config.sensor.model().mounting
    # On a circle about the middle of the free part of the room.
    home, ends = pose(-0.6, -0.2, 0.0), 0.1 * np.arange(8)

    def at(time):
        turn = velocity[2] * time
        radius = velocity[0] / velocity[2]
        return compose(home, pose(radius * math.sin(turn), radius * (1.0 - math.cos(turn)), turn))

    for end in ends:
        times = np.linspace(-0.1, 0.0, len(FULL_TURN), endpoint=False)
        scan = exact(ROOM, mounting, [at(end + time) for time in times], times)
        step = slam.process(Frame(end, told(at(end)), LaserScan(scan.ranges, scan.angles, end, times)))
    return transform(at(step.stamp), mounting.points_to_robot(step.features.corners.positions))


@MOUNTINGS
@pytest.mark.parametrize("source", ["line-aided", "wheel", "lines"])
def test_the_motion_during_a_scan_is_undone_by_what_tells_it(mounting, source):
    """Wheels tell the motion; without them the poses found so far do, and the wheels are not looked at."""

    config = config_of(source=source)
    config = config.model_copy(update={"sensor": config.sensor.of_preset("rplidar-s1", mounting)})

    def told(truth):
        return pose() if source == "lines" else truth

    # Between two records the robot is taken to go straight: of an arc of 0.08 m and 0.1 rad that is 1 mm, and some
    # beams in the middle of a turn are off by as much; without wheels the velocity is known to a few per cent.
    allowed = 0.03 if source == "lines" else 0.01
    assert nearest(last_corners(config, told), ROOM.corners).max() < allowed
    as_taken = last_corners(with_front_end(config, deskew=False), told)
    # A corner at 2 m turns by up to 0.1 rad during the scan.
    assert nearest(as_taken, ROOM.corners).max() > 0.05
