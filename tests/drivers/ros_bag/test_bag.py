"""ROS bags: every kind gives the same frames, odometry and mounting are found, what is wrong is one clear line."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest
from bags import KINDS, START, Messages
from hypothesis import given
from hypothesis import strategies as st

from drivers import LogFormatError, open_log
from drivers.ros_bag.frames import rotation_of

RANGES = [1.0, 2.0, math.nan, math.inf, 0.05, 9.0, 8.0, -1.0, 3.5]
READ = [1.0, 2.0, *[math.inf] * 6, 3.5]


@pytest.fixture(params=KINDS)
def messages(request: pytest.FixtureRequest) -> Messages:
    """An empty bag of each kind."""
    return Messages(request.param)


@pytest.fixture
def plain() -> Messages:
    """An empty ROS 1 bag, for what does not depend on the kind."""
    return Messages("rosbag1")


def frames_of(path: Path, **topics: str):
    return list(open_log(path, **topics))


def error_of(path: Path, **topics: str) -> str:
    """Message of a log that cannot be opened or read: one line."""
    with pytest.raises(LogFormatError) as raised:
        frames_of(path, **topics)
    assert "\n" not in str(raised.value)
    return str(raised.value)


def test_scans_and_odometry_of_every_kind(messages, tmp_path):
    """A scan has the odometry of its stamp, interpolated; odometry between is a frame of its own."""
    for k in range(5):
        messages.odometry(START + 0.2 * k, 0.4 * k, 1.0, 0.1 * k)
    messages.scan(START + 0.1, RANGES, time_increment=0.001)
    messages.text(START)
    source = open_log(messages.write(tmp_path))
    assert source.name == "drive"
    assert source.has_odometry
    frames = list(source)
    assert source.progress == 1.0
    assert [frame.stamp for frame in frames] == pytest.approx(np.array([0.0, 0.1, 0.2, 0.4, 0.6, 0.8]) + START)
    scan = frames[1].scan
    assert [frame.scan is None for frame in frames] == [True, False, True, True, True, True]
    np.testing.assert_array_equal(scan.ranges, READ)
    np.testing.assert_array_equal(scan.angles, -1.0 + 0.25 * np.arange(9))
    np.testing.assert_allclose(scan.times, 0.001 * np.arange(9))
    assert scan.stamp == frames[1].stamp
    np.testing.assert_allclose(frames[2].pose_odom_robot, [0.4, 1.0, 0.1], atol=1e-12)
    # Half of the motion, which as seen from the first pose is (0.4, 0) and 0.1 rad; the clock ticks in 0.24 us.
    np.testing.assert_allclose(frames[1].pose_odom_robot, [0.2, 1.0, 0.05], atol=2e-6)


def test_a_file_of_a_ros2_bag_is_read_without_its_folder(tmp_path):
    for kind in ("mcap", "sqlite3"):
        messages = Messages(kind)
        messages.scan(START, RANGES)
        (tmp_path / kind).mkdir()
        folder = messages.write(tmp_path / kind)
        (file,) = (path for path in folder.iterdir() if path.suffix != ".yaml")
        (alone,) = frames_of(file)
        np.testing.assert_array_equal(alone.scan.ranges, READ)
        # A recorder that was killed writes no metadata.
        (folder / "metadata.yaml").unlink()
        with pytest.raises(LogFormatError, match="cut short or damaged"):
            frames_of(folder)
        found = iter(open_log(folder))
        np.testing.assert_array_equal(next(found).scan.ranges, READ)


def test_beams_that_run_clockwise(plain, tmp_path):
    plain.scan(START, RANGES, angle_min=1.0, angle_max=-1.0, angle_increment=-0.25)
    (frame,) = frames_of(plain.write(tmp_path))
    np.testing.assert_array_equal(frame.scan.angles, 1.0 - 0.25 * np.arange(9))
    np.testing.assert_array_equal(frame.scan.ranges, READ)
    assert frame.scan.times is None


def test_without_odometry_the_poses_are_the_origin(messages, tmp_path):
    for k in range(3):
        messages.scan(START + k, RANGES)
    source = open_log(messages.write(tmp_path))
    assert not source.has_odometry
    frames = list(source)
    assert len(frames) == 3
    assert all((frame.pose_odom_robot == 0.0).all() for frame in frames)


def test_odometry_of_tf_where_no_topic_tells_it(messages, tmp_path):
    for k in range(3):
        messages.transform(START + k, "/odom", "/base_footprint", (2.0 * k, 1.0, 0.0), 0.2 * k)
        messages.transform(START + k, "map", "odom", (100.0, 0.0, 0.0), 1.0)
    messages.transform(START, "base_footprint", "base_link", (0.1, 0.0, 0.2), 0.0, topic="/tf_static")
    messages.transform(START, "base_link", "laser", (0.2, 0.05, 0.3), 0.5, topic="/tf_static")
    messages.scan(START + 1.0, RANGES, frame_id="/laser")
    source = open_log(messages.write(tmp_path))
    assert source.has_odometry
    frames = list(source)
    assert len(frames) == 4
    poses = [frame.pose_odom_robot for frame in frames if frame.scan is None]
    np.testing.assert_allclose(poses, [[0.0, 1.0, 0.0], [2.0, 1.0, 0.2], [4.0, 1.0, 0.4]], atol=1e-12)
    (scan,) = (frame for frame in frames if frame.scan is not None)
    np.testing.assert_allclose(scan.pose_odom_robot, [2.0, 1.0, 0.2], atol=1e-12)
    mounting = source.mounting
    assert (mounting.x, mounting.y, mounting.theta) == pytest.approx((0.3, 0.05, 0.5))
    assert not mounting.upside_down


def test_a_topic_of_odometry_comes_before_tf(plain, tmp_path):
    for k in range(2):
        plain.transform(START + k, "odom", "base_link", (9.0, 9.0, 0.0), 0.0)
        plain.odometry(START + k, 1.0, 2.0, 0.5)
    plain.scan(START + 0.5, RANGES)
    for frame in frames_of(plain.write(tmp_path)):
        np.testing.assert_allclose(frame.pose_odom_robot, [1.0, 2.0, 0.5])


angles = st.floats(-3.0, 3.0)
lengths = st.floats(-2.0, 2.0)


@pytest.mark.slow
@given(x=lengths, y=lengths, yaw=angles, base_x=lengths, base_yaw=angles, over=st.booleans())
def test_mounting_is_that_of_the_chain_of_frames(tmp_path_factory, x, y, yaw, base_x, base_yaw, over):
    """Points of the scanner come to the same place as by three-dimensional transforms; also hung upside down."""
    roll = math.pi if over else 0.0
    plain = Messages("rosbag1")
    plain.transform(START, "base_footprint", "base_link", (base_x, 0.3, 0.1), base_yaw)
    plain.transform(START, "base_link", "laser", (x, y, 0.4), yaw, roll)
    plain.odometry(START, 0.0, 0.0, 0.0, child="base_footprint")
    plain.scan(START, RANGES)
    mounting = open_log(plain.write(tmp_path_factory.mktemp("bag"))).mounting
    assert mounting.upside_down == over

    def turned(angle: float) -> np.ndarray:
        return rotation_of(plain.quaternion(0.0, angle))

    flip = np.diag([1.0, -1.0, -1.0]) if over else np.eye(3)
    points = np.array([[1.0, 0.0, 0.0], [0.5, 2.0, 0.0], [-3.0, 1.0, 0.0]])
    in_base = points @ (turned(yaw) @ flip).T + [x, y, 0.4]
    expected = in_base @ turned(base_yaw).T + [base_x, 0.3, 0.1]
    np.testing.assert_allclose(mounting.points_to_robot(points[:, :2]), expected[:, :2], atol=1e-9)


def test_an_inclined_scanner_is_refused(plain, tmp_path):
    plain.transform(START, "base_link", "laser", (0.0, 0.0, 1.0), 0.0, roll=0.5)
    plain.scan(START, RANGES)
    assert "inclined by 29 deg" in error_of(plain.write(tmp_path))


def test_a_mounting_that_is_not_told_is_said_where_it_matters(plain, tmp_path, caplog):
    plain.odometry(START, 0.0, 0.0, 0.0)
    plain.odometry(START + 1.0, 0.0, 0.0, 0.0)
    plain.scan(START + 0.5, RANGES)
    with caplog.at_level(logging.WARNING, logger="drivers"):
        assert open_log(plain.write(tmp_path)).mounting.x == 0.0
    assert "the mounting of the scanner 'laser' is not in tf" in caplog.text


def test_scans_without_odometry_around_them_are_left_out_and_counted(plain, tmp_path, caplog):
    for time in (1.0, 2.0, 8.0, 9.0):
        plain.odometry(START + time, time, 0.0, 0.0)
    for time in (0.5, 1.5, 4.0, 8.5, 9.5):
        plain.scan(START + time, RANGES)
    with caplog.at_level(logging.WARNING, logger="drivers"):
        scans = [frame for frame in frames_of(plain.write(tmp_path)) if frame.scan is not None]
    assert [frame.stamp - START for frame in scans] == [1.5, 8.5]
    np.testing.assert_allclose([frame.pose_odom_robot[0] for frame in scans], [1.5, 8.5])
    assert "3 of 5 scans are left out" in caplog.text


def test_stamps_of_two_clocks_are_an_error(plain, tmp_path):
    plain.odometry(START, 0.0, 0.0, 0.0)
    plain.odometry(START + 1.0, 0.0, 0.0, 0.0)
    plain.scan(START + 30.0, RANGES)
    assert "no scan of /scan lies between two odometry poses of /odom: expected stamps of one clock" in error_of(
        plain.write(tmp_path)
    )


def test_frames_come_in_the_order_of_their_stamps_not_of_recording(plain, tmp_path):
    for stamp, received in ((0.3, 0.4), (0.1, 0.5), (0.2, 0.45), (0.0, 0.6)):
        plain.scan(START + stamp, RANGES, received=START + received)
    assert [frame.stamp - START for frame in frames_of(plain.write(tmp_path))] == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_a_stamp_that_is_not_set_is_the_time_of_recording(plain, tmp_path):
    plain.scan(0.0, RANGES, received=START + 5.0)
    (frame,) = frames_of(plain.write(tmp_path))
    assert frame.stamp == frame.scan.stamp == START + 5.0


def test_topics_are_chosen_or_listed(messages, tmp_path):
    for topic in ("/front", "/rear"):
        messages.scan(START, RANGES, topic=topic)
    messages.scan(START + 1.0, RANGES, topic="/front")
    messages.text(START)
    path = messages.write(tmp_path)
    both = "/front (sensor_msgs/LaserScan, 2), /rear (sensor_msgs/LaserScan, 1)"
    assert error_of(path) == f"{path}: choose one with --scan-topic: it has {both}"
    assert error_of(path, scan_topic="/scan") == (
        f"{path} has no topic /scan: it has /chatter (std_msgs/String, 1), {both}"
    )
    assert error_of(path, scan_topic="/chatter") == (
        f"{path}: expected a topic of sensor_msgs/LaserScan: it has /chatter (std_msgs/String, 1)"
    )
    assert len(frames_of(path, scan_topic="/front")) == 2
    assert len(frames_of(path, scan_topic="/rear")) == 1


def test_odometry_is_chosen_or_listed(plain, tmp_path):
    for topic, x in (("/wheels", 1.0), ("/filtered", 2.0)):
        for k in range(2):
            plain.odometry(START + k, x, 0.0, 0.0, topic=topic)
    plain.scan(START, RANGES)
    path = plain.write(tmp_path)
    assert "choose one with --odom-topic: it has /filtered (nav_msgs/Odometry, 2), /wheels (" in error_of(path)
    assert frames_of(path, odom_topic="/filtered")[0].pose_odom_robot[0] == 2.0


def test_a_bag_without_scans_says_what_it_has(messages, tmp_path):
    messages.text(START)
    path = messages.write(tmp_path)
    assert error_of(path) == (
        f"{path} has no scans: expected a topic of sensor_msgs/LaserScan: it has /chatter (std_msgs/String, 1)"
    )


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"range_max": 0.0}, "range_min 0.1, range_max 0: expected 0 <= range_min < range_max"),
        ({"range_min": math.nan}, "range_min nan"),
        ({"angle_min": math.nan}, "angle of beam 0 is nan"),
        ({"time_increment": math.inf}, "time_increment is inf"),
    ],
)
def test_an_unusable_scan_is_named_after_those_before_it(plain, tmp_path, fields, reason):
    plain.scan(START, RANGES)
    plain.scan(START + 1.0, RANGES, **fields)
    frames = iter(open_log(plain.write(tmp_path)))
    assert next(frames).stamp == START
    with pytest.raises(LogFormatError, match=r"/scan at 1700000001\.000 s: ") as raised:
        next(frames)
    assert reason in str(raised.value)


def test_an_unusable_odometry_pose_is_named(plain, tmp_path):
    plain.odometry(START, math.nan, 0.0, 0.0)
    plain.scan(START, RANGES)
    assert "/odom at 1700000000.000 s: position nan 0: expected metres" in error_of(plain.write(tmp_path))


def test_a_clock_that_goes_back_is_an_error(plain, tmp_path):
    plain.scan(START, RANGES, received=START)
    plain.scan(START + 100.0, RANGES, received=START + 100.0)
    plain.scan(START - 1.0, RANGES, received=START + 101.0)
    assert "/scan: stamp 1699999999.000 goes back by 101.000 s" in error_of(plain.write(tmp_path))


def test_what_is_no_bag_is_said(tmp_path):
    (tmp_path / "folder").mkdir()
    assert "is a folder without metadata.yaml, .db3 or .mcap files" in error_of(tmp_path / "folder")
    assert "no such file or folder" in error_of(tmp_path / "none.bag")
    (tmp_path / "empty.bag").touch()
    assert "is empty" in error_of(tmp_path / "empty.bag")
    (tmp_path / "text.mcap").write_text("hello")
    assert "does not begin as a ROS bag" in error_of(tmp_path / "text.mcap")
    (tmp_path / "log.clf").write_text("FLASER 1 1 0 0 0 0 0 0 1 h 1\n")
    assert "drop --scan-topic" in error_of(tmp_path / "log.clf", scan_topic="/scan")
    assert "drop --scan-topic" in error_of(tmp_path / "log.clf", odom_topic="/odom")


@pytest.mark.parametrize("topic", ["front", "rear"])
def test_two_real_scanners(two_lidars, topic):
    """726 beams of 5.6 m at 10 Hz for 33 s, no odometry; the rear scanner lacks one scan."""
    source = open_log(two_lidars, scan_topic=f"/{topic}_scan")
    assert not source.has_odometry
    frames = list(source)
    assert len(frames) == {"front": 331, "rear": 330}[topic]
    stamps = np.array([frame.stamp for frame in frames])
    assert np.diff(stamps).min() > 0.09
    for frame in frames:
        returned = np.isfinite(frame.scan.ranges)
        assert frame.scan.ranges[returned].min() >= 0.02
        assert frame.scan.ranges[returned].max() < 5.6
        assert returned.sum() > 300
        assert np.ptp(frame.scan.times) == pytest.approx(0.0708, abs=1e-4)
