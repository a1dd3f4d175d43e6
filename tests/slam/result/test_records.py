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
            records.add_scan(10.0 + k, odom, pose(0.0, 1.0 * k, 0.0), pose(-1.0 * k, 0.0, 3.0))
    return records


def test_the_trajectories_are_what_was_told_at_its_stamps():
    records = kept()
    assert (len(records), len(records.scans)) == (5, 2)
    stamps = 10.0 + np.arange(5)
    for trajectory in (records.wheels(), records.odometry()):
        np.testing.assert_array_equal(trajectory.stamps, stamps)
    np.testing.assert_array_equal(records.wheels().poses, [[k, 0.0, 0.25 * k] for k in range(5)])
    np.testing.assert_allclose(records.odometry().poses[[1, 4]], [[0.0, 1.0, 0.0], [0.0, 4.0, 0.0]], atol=1e-12)
    online = records.online()
    np.testing.assert_array_equal(online.stamps, stamps[[1, 4]])
    np.testing.assert_array_equal(online.poses, [[-1.0, 0.0, 3.0], [-4.0, 0.0, 3.0]])


def test_records_of_one_stamp_are_told_apart_in_every_trajectory_alike():
    """A clock of one second, three records a tick, each a little further: none at the same time as another."""
    records = Records()
    for k in range(12):
        records.add(float(k // 3), pose(0.25 * k), pose(0.2 * k))
        records.add_scan(float(k // 3), pose(0.25 * k), pose(0.2 * k), pose(0.3 * k))
    times = records.times()
    assert (np.diff(times) > 0.0).all()
    assert np.abs(times - np.arange(12) // 3).max() <= 0.5
    for trajectory in (records.wheels(), records.odometry(), records.online()):
        np.testing.assert_array_equal(trajectory.stamps, times)


def driven(scan_stamp, *, has_odometry=True):
    """Wheels that miss a quarter of the way, and two scans that tell it, each ``scan_stamp`` after its record."""
    records = Records(has_odometry=has_odometry)
    for k in range(9):
        stamp, wheels = 0.1 * k, 0.75 * 0.1 * k
        records.add(stamp, pose(wheels), pose(7.0))
        if k % 4 == 0:
            at = max(0.0, stamp + scan_stamp)
            records.add_scan(at, pose(0.75 * at), pose(at, 0.02), pose(at, 0.02))
    return records


@pytest.mark.parametrize("scan_stamp", [-0.05, -0.02, 0.0, 0.03])
@pytest.mark.parametrize("has_odometry", [True, False])
def test_a_record_between_two_scans_is_carried_from_both(scan_stamp, has_odometry):
    """A steady motion has no teeth: neither by odometry nor by the corrected poses, wherever a scan has its stamp."""
    records = driven(scan_stamp, has_odometry=has_odometry)
    stamps, last = 0.1 * np.arange(9), 0.8 + scan_stamp
    inside = (stamps >= max(0.0, scan_stamp)) & (stamps <= last)
    poses = records.odometry().poses
    np.testing.assert_allclose(
        poses[inside], np.column_stack([stamps, np.full(9, 0.02), np.zeros(9)])[inside], atol=1e-9
    )
    at = np.array([scan.stamp for scan in records.scans])
    corrected = records.corrected(np.array([0, 2]), np.column_stack([2.0 * at[[0, 2]], np.zeros((2, 2))])).poses
    np.testing.assert_allclose(corrected[inside], np.column_stack([2.0 * stamps, np.zeros((9, 2))])[inside], atol=1e-9)


def test_a_scan_without_times_and_its_record_are_at_one_place():
    records = driven(0.0)
    for scan, place in zip(records.scans, records.odometry().poses[::4], strict=True):
        np.testing.assert_allclose(place, scan.pose_map, atol=1e-12)


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
