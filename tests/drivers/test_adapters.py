from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.adapters import Paced, SourceAdapter, WithOdometry
from drivers.frame import Frame, FrameSource, SourceInfo
from features.scan import LaserScan
from features.sensor import Mounting


class Frames(FrameSource):
    """A source of frames at given stamps."""

    info, progress = SourceInfo("hall", "rplidar-s1", Mounting(0.1, 0.2, 0.3), has_odometry=False), 0.5

    def __init__(self, stamps):
        self.frames = [Frame(t, np.zeros(3), LaserScan(np.ones(3), np.array([0.0, 0.1, 0.2]), t)) for t in stamps]

    def __iter__(self):
        return iter(self.frames)


class Clock:
    """A clock that sleeping moves on, and a slow taker of frames too."""

    def __init__(self):
        self.time = 100.0

    def now(self):
        return self.time

    def sleep(self, duration):
        assert duration > 0.0
        self.time += duration


@given(
    st.lists(st.floats(0.0, 2.0), min_size=1, max_size=20),
    st.lists(st.floats(0.0, 2.0), min_size=20, max_size=20),
    st.floats(0.1, 100.0),
)
def test_no_frame_comes_before_its_time_and_none_later_than_its_taker_allows(intervals, work, speed):
    stamps = np.cumsum(intervals).tolist()
    clock = Clock()
    free = clock.time
    for frame, busy in zip(Paced(Frames(stamps), speed, clock.now, clock.sleep), work, strict=False):
        due = 100.0 + (frame.stamp - stamps[0]) / speed
        assert clock.time == pytest.approx(max(due, free), abs=1e-9)
        clock.time += busy
        free = clock.time


def test_an_adapter_passes_on_what_its_source_says():
    source = Frames([0.0])
    adapter = SourceAdapter(source)
    assert (adapter.info, adapter.progress) == (source.info, 0.5)
    assert list(adapter) == source.frames


def test_a_source_offers_the_values_of_its_info():
    info = SourceInfo("hall", "rplidar-s1", Mounting(0.1, 0.2, 0.3), has_odometry=False)
    source = Frames([])
    assert (source.name, source.sensor, source.mounting, source.has_odometry) == (
        info.name,
        info.sensor,
        info.mounting,
        info.has_odometry,
    )


def test_a_source_without_info_cannot_be_made():
    class Nameless(FrameSource):
        progress = 0.0

        def __iter__(self):
            return iter(())

    with pytest.raises(TypeError, match="info"):
        Nameless()


def test_odometry_joins_the_frames_at_their_stamps():
    class Wheels:
        def at(self, stamp):
            return np.array([stamp, 2.0 * stamp, 0.1])

    source = WithOdometry(Frames([1.0, 2.0]), Wheels())
    assert source.info == replace(source.source.info, has_odometry=True)
    assert [frame.pose_odom_robot.tolist() for frame in source] == [[1.0, 2.0, 0.1], [2.0, 4.0, 0.1]]
