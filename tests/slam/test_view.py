"""What a frame shows: corners in the robot's frame, without the motion during the scan, or landmarks as given."""

import math

import numpy as np
import pytest
from observed_corners import corners
from scenes import FULL_TURN, polygon

from drivers.frame import Frame, LandmarkObservations
from features.scan import LaserScan
from features.se2 import compose, pose, rotation, transform
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


def config_of(mounting=Mounting(), front_end=None, **odometry):  # noqa: B008, it is frozen
    config = SlamConfig.of_preset("rplidar-s1", mounting)
    changed = {"odometry": config.odometry.model_copy(update=odometry)}
    changed["front_end"] = config.front_end.model_copy(update=front_end or {})
    return config.model_copy(update=changed)


def seen(scan, config):
    return view_of_scan(scan, config.sensor.model(), CwlfExtractor(config.extraction))


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
    config, here = config_of(mounting), pose(-0.6, 0.2, 0.9)
    scan = exact(ROOM, mounting, here)
    view = seen(scan, config)
    found = transform(here, view.corners_robot.positions)
    assert len(found) == len(ROOM.corners)
    # Without noise a corner is off by what the split of its lines at a beam leaves: millimetres.
    assert nearest(found, ROOM.corners).max() < 5e-3
    key_frame = KeyFrame.of(7, view, config.sensor.model())
    assert key_frame.record == 7
    assert len(key_frame.points_robot) == len(scan)
    assert off_walls(transform(here, key_frame.points_robot), ROOM).max() < 1e-9
    assert key_frame.walls_robot.shape == (len(view.features.lines), 2, 2)
    assert off_walls(transform(here, key_frame.walls_robot.reshape(-1, 2)), ROOM).max() < 5e-3


def test_a_key_frame_keeps_the_points_within_the_limits_of_the_sensor_only():
    config = config_of()
    sensor = config.sensor.model()
    scan = exact(ROOM, Mounting(), pose())
    ranges = scan.ranges.copy()
    ranges[100:104] = [0.0, 0.5 * sensor.range_min, 1.5 * sensor.range_max, math.inf]
    view = seen(LaserScan(ranges, scan.angles), config)
    kept = KeyFrame.of(0, view, sensor).points_robot
    np.testing.assert_allclose(np.hypot(*kept.T), np.delete(ranges, range(100, 104)), rtol=1e-12)


OBSERVED = LandmarkObservations(np.array([2.0, 3.0]), np.array([0.5, -0.4]), None, np.array([5, 2]))


def test_of_landmarks_that_a_sensor_found_itself_a_key_frame_keeps_no_scan():
    sensor = config_of().sensor.model()
    view = view_of_observations(OBSERVED, sensor, use_identities=True)
    assert view.scan is None
    kept = KeyFrame.of(3, view, sensor)
    assert (kept.record, kept.walls_robot.shape, kept.points_robot.shape) == (3, (0, 2, 2), (0, 2))


@pytest.mark.parametrize("used", [True, False])
def test_identities_of_landmarks_are_taken_where_they_are_to_be(used):
    view = view_of_observations(OBSERVED, config_of().sensor.model(), use_identities=used)
    assert (None if view.identities is None else view.identities.tolist()) == ([5, 2] if used else None)
    np.testing.assert_allclose(
        view.corners_robot.positions, [2.0 * rotation(0.5)[:, 0], 3.0 * rotation(-0.4)[:, 0]], rtol=1e-12
    )


def test_observations_are_the_corners_that_are_of_a_landmark_with_the_scatter_of_real_ones():
    shown = corners([[1.0, 0.0], [0.0, 2.0], [3.0, 1.0]])
    observations = View(shown).observations(np.array([4, -1, 0]), 0.02)
    assert observations.landmarks.tolist() == [4, 0]
    np.testing.assert_array_equal(observations.positions_robot, shown.positions[[0, 2]])
    np.testing.assert_allclose(observations.covs, shown.covs[[0, 2]] + 0.02**2 * np.eye(2), rtol=1e-12)


def test_a_record_of_odometry_shows_nothing():
    assert Slam(config_of()).process(Frame(0.0, pose())).features is None


def test_landmarks_that_a_sensor_found_itself_need_wheels():
    slam = Slam(config_of(source="lines"))
    with pytest.raises(ConfigError, match=r"odometry\.source is 'lines'.*expected 'line-aided' or 'wheel'"):
        slam.process(Frame(0.0, pose(), observations=OBSERVED))


def last_corners(config, told):
    """Corners of the last scan of a robot at 0.8 m/s and 1 rad/s that scans for 0.1 s, in the world of its truth.

    ``told`` : what the wheels tell of a true pose.
    """
    slam, velocity, mounting = Slam(config), np.array([0.8, 0.0, 1.0]), config.sensor.model().mounting
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
    return transform(at(ends[-1]), mounting.points_to_robot(step.features.corners.positions))


@MOUNTINGS
@pytest.mark.parametrize("source", ["line-aided", "wheel", "lines"])
def test_the_motion_during_a_scan_is_undone_by_what_tells_it(mounting, source):
    """Wheels tell the motion; without them the poses found so far do, and the wheels are not looked at."""

    def told(truth):
        return pose() if source == "lines" else truth

    # Between two records the robot is taken to go straight: of an arc of 0.08 m and 0.1 rad that is 1 mm, and some
    # beams in the middle of a turn are off by as much; without wheels the velocity is known to a few per cent.
    allowed = 0.03 if source == "lines" else 0.01
    assert nearest(last_corners(config_of(mounting, source=source), told), ROOM.corners).max() < allowed
    as_taken = last_corners(config_of(mounting, {"deskew": False}, source=source), told)
    # A corner at 2 m turns by up to 0.1 rad during the scan.
    assert nearest(as_taken, ROOM.corners).max() > 0.05
