"""Records: frames that may follow, those that may not, and the three trajectories of what was told."""

import math

import numpy as np
import pytest

from drivers.frame import Frame
from features.se2 import pose
from slam.result.records import Records


def kept():
    """Five records, of which the second and the last have a scan."""
    records = Records()
    for k in range(5):
        odom = records.checked(Frame(10.0 + k, pose(1.0 * k, 0.0, 0.25 * k)))
        records.add(10.0 + k, odom, pose(0.0, 1.0 * k, 0.0))
        if k in (1, 4):
            records.add_scan(pose(-1.0 * k, 0.0, 3.0))
    return records


def test_the_trajectories_are_what_was_told_at_its_stamps():
    records = kept()
    assert (len(records), records.scans) == (5, 2)
    stamps = 10.0 + np.arange(5)
    for trajectory in (records.wheels(), records.odometry()):
        np.testing.assert_array_equal(trajectory.stamps, stamps)
    np.testing.assert_array_equal(records.wheels().poses, [[k, 0.0, 0.25 * k] for k in range(5)])
    np.testing.assert_array_equal(records.odometry().poses, [[0.0, k, 0.0] for k in range(5)])
    online = records.online()
    np.testing.assert_array_equal(online.stamps, stamps[[1, 4]])
    np.testing.assert_array_equal(online.poses, [[-1.0, 0.0, 3.0], [-4.0, 0.0, 3.0]])


def test_records_of_one_stamp_are_told_apart_in_every_trajectory_alike():
    """A clock of one second, three records a tick, each a little further: none at the same time as another."""
    records = Records()
    for k in range(12):
        records.add(float(k // 3), pose(0.25 * k), pose(0.2 * k))
        records.add_scan(pose(0.3 * k))
    times = records.times()
    assert (np.diff(times) > 0.0).all()
    assert np.abs(times - np.arange(12) // 3).max() <= 0.5
    for trajectory in (records.wheels(), records.odometry(), records.online()):
        np.testing.assert_array_equal(trajectory.stamps, times)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (Frame(13.9, pose()), "smaller than 14.0"),
        (Frame(math.nan, pose()), "not finite"),
        (Frame(math.inf, pose()), "not finite"),
        (Frame(15.0, pose(math.nan)), "not finite"),
        (Frame(15.0, np.array([0.0, 0.0, math.inf])), "not finite"),
        (Frame(15.0, np.zeros(2)), "shape"),
        (Frame(15.0, np.zeros((1, 3))), "shape"),
    ],
)
def test_a_frame_that_may_not_follow_is_refused_and_changes_nothing(frame, message):
    records = kept()
    with pytest.raises(ValueError, match=message):
        records.checked(frame)
    assert len(records) == 5
    records.checked(Frame(14.0, pose()))  # the same stamp may follow


def test_the_pose_of_a_frame_is_copied_as_its_owner_may_write_to_it():
    own = pose(1.0, 2.0, 3.0)
    taken = Records().checked(Frame(0.0, own))
    own[0] = 9.0
    np.testing.assert_array_equal(taken, [1.0, 2.0, 3.0])
