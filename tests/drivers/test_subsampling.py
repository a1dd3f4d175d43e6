"""Subsampling: which frames are left, which of them have a scan, and that all else is unchanged."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, LandmarkObservations, SourceInfo
from drivers.subsampling import Subsampled
from features.scan import LaserScan
from features.sensor import Mounting


class Source(FrameSource):
    """Frames at whole seconds, a scan in some of them."""

    info, progress = SourceInfo("source", "rplidar-s1", Mounting(x=0.1)), 0.5

    def __init__(self, has_scan):
        self.frames = [
            Frame(100.0 + k, np.array([0.1 * k, 0.0, 0.0]), LaserScan(np.ones(3), np.arange(3.0), k) if scan else None)
            for k, scan in enumerate(has_scan)
        ]

    def __iter__(self):
        return iter(self.frames)


@given(st.lists(st.booleans(), min_size=1, max_size=30), st.integers(1, 6), st.integers(0, 20))
def test_records_keep_their_odometry_and_one_scan_of_so_many_is_left(has_scan, every, skip):
    source = Source(has_scan)
    wanted = source.frames[skip:]
    scans = [frame for frame in wanted if frame.scan is not None]
    subsampled = Subsampled(source, every, float(skip))
    if not scans:
        with pytest.raises(LogFormatError, match="skip less"):
            list(subsampled)
        return
    for _ in range(2):
        frames = list(subsampled)
        assert [frame.stamp for frame in frames] == [frame.stamp for frame in wanted]
        assert all(got.pose_odom_robot is frame.pose_odom_robot for got, frame in zip(frames, wanted, strict=True))
        assert [f.scan for f in frames if f.scan is not None] == [f.scan for f in scans[::every]]


def test_ready_made_observations_are_left_like_scans():
    seen = LandmarkObservations(np.ones(1), np.zeros(1))
    source = Source([False] * 5)
    source.frames = [replace(frame, observations=seen) for frame in source.frames]
    assert [frame.observations is seen for frame in Subsampled(source)] == [True] * 5
    assert [frame.observations is seen for frame in Subsampled(source, every=2)] == [True, False, True, False, True]


def test_subsampling_changes_neither_info_nor_progress():
    source = Source([True])
    assert (Subsampled(source).info, Subsampled(source).progress) == (source.info, 0.5)


@pytest.mark.parametrize(("every", "skip"), [(0, 0.0), (1, -1.0), (1, float("nan"))])
def test_misuse(every, skip):
    with pytest.raises(ValueError, match="expected"):
        Subsampled(Source([True]), every, skip)
