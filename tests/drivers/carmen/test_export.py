"""CARMEN logs that we write are read as what was written."""

import gzip
import logging

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import CarmenLog, Frame, RecordError, write_carmen
from features.scan import LaserScan
from features.sensor import Mounting

RANGE_MAX = 40.0


def frame(stamp, pose, angles, ranges, times=None):
    return Frame(stamp, np.array(pose), LaserScan(np.asarray(ranges), np.asarray(angles), stamp, times))


@pytest.mark.slow
@settings(derandomize=True, deadline=None)
@given(
    start=st.floats(-4.0, 4.0),
    spacing=st.floats(-0.1, 0.1).filter(lambda value: abs(value) > 1e-4),
    ranges=st.lists(st.floats(0.0, 39.0) | st.just(np.inf), min_size=1, max_size=30),
    pose=st.tuples(st.floats(-500.0, 500.0), st.floats(-500.0, 500.0), st.floats(-3.1, 3.1)),
    mounting=st.builds(Mounting, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.booleans()),
)
def test_what_is_written_is_read(start, spacing, ranges, pose, mounting, tmp_path_factory):
    """Stamps and ranges to the micro, poses to the nano; an upside-down sensor as one with its beams the other way."""
    path = tmp_path_factory.mktemp("carmen") / "drive.log"
    angles = start + spacing * np.arange(len(ranges))
    odometry = Frame(0.02, np.array(pose))
    write_carmen(path, [frame(0.0, pose, angles, ranges), odometry], mounting, RANGE_MAX)
    log = CarmenLog(path)
    scanned, between = log
    np.testing.assert_allclose(scanned.pose_odom_robot, pose, atol=1e-9)
    np.testing.assert_allclose(scanned.scan.ranges, ranges, atol=0.51e-6)
    assert between.stamp == 0.02
    assert between.scan is None
    read = log.mounting
    assert not read.upside_down
    for got, wanted in zip(scanned.scan.angles, angles, strict=True):
        turn = read.direction_to_robot(got) - mounting.direction_to_robot(wanted)
        assert abs(np.sin(turn / 2.0)) < 1e-9
    assert (read.x, read.y, read.theta) == pytest.approx((mounting.x, mounting.y, mounting.theta))


def test_a_name_with_gz_is_gzipped(tmp_path):
    path = tmp_path / "drive.log.gz"
    write_carmen(path, [frame(0.0, (0, 0, 0), [0.0, 0.1], [1.0, 2.0])], Mounting(), RANGE_MAX)
    assert gzip.decompress(path.read_bytes()).startswith(b"PARAM")
    assert len(list(CarmenLog(path))) == 1


def test_uneven_beams_are_refused(tmp_path):
    with pytest.raises(RecordError, match=r"scan at 3.000000 s: beam 1 is 1\.\d+ deg off an even spacing"):
        write_carmen(tmp_path / "d.log", [frame(3.0, (0, 0, 0), [0.0, 0.12, 0.2], [1, 1, 1])], Mounting(), RANGE_MAX)


def test_times_of_beams_are_left_out_and_said_once(tmp_path, caplog):
    frames = [frame(float(k), (0, 0, 0), [0.0, 0.1], [1, 1], np.array([0.0, 0.05])) for k in range(3)]
    with caplog.at_level(logging.WARNING):
        write_carmen(tmp_path / "d.log", frames, Mounting(), RANGE_MAX)
    assert len(caplog.records) == 1
    assert next(iter(CarmenLog(tmp_path / "d.log"))).scan.times is None


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(RecordError, match="cannot be written"):
        write_carmen(tmp_path, [], Mounting(), RANGE_MAX)
