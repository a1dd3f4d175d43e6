import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam.result.trajectory import Trajectory, separate_equal_stamps


def random_trajectory(seed, count=50):
    rng = np.random.default_rng(seed)
    stamps = 976052857.0 + np.sort(rng.uniform(0.0, 100.0, count)).round(6)
    poses = np.column_stack([rng.normal(0.0, 50.0, (count, 2)), rng.uniform(-math.pi, math.pi, count)])
    return Trajectory(stamps, poses)


@pytest.mark.parametrize(
    ("stamps", "poses"),
    [
        ([0.0, 1.0], np.zeros((3, 3))),
        ([0.0], np.zeros((1, 2))),
        ([[0.0]], np.zeros((1, 3))),
        ([0.0, math.nan], np.zeros((2, 3))),
        ([0.0], [[0.0, math.inf, 0.0]]),
        ([1.0, 0.0], np.zeros((2, 3))),
    ],
)
def test_what_is_no_trajectory_is_refused(stamps, poses):
    with pytest.raises(ValueError, match="expected"):
        Trajectory(np.array(stamps), np.array(poses))


def test_equal_stamps_and_no_poses_are_trajectories():
    assert len(Trajectory(np.array([1.0, 1.0]), np.zeros((2, 3)))) == 2
    assert len(Trajectory(np.array([]), np.zeros((0, 3)))) == 0


def test_interpolation_turns_the_shorter_way():
    trajectory = Trajectory(np.array([0.0, 2.0]), np.array([[0.0, 0.0, 3.0], [4.0, -2.0, -3.0]]))
    (pose,) = trajectory.at([1.0])
    assert pose[:2] == pytest.approx([2.0, -1.0])
    assert abs(pose[2]) == pytest.approx(math.pi)
    assert trajectory.at([0.5])[0, 2] == pytest.approx(3.0 + (2 * math.pi - 6.0) / 4)


def test_interpolation_at_the_stamps_gives_the_poses():
    trajectory = random_trajectory(1)
    np.testing.assert_allclose(trajectory.at(trajectory.stamps), trajectory.poses, atol=1e-12)


def test_interpolation_takes_the_ends_within_the_tolerance_only():
    trajectory = Trajectory(np.array([1.0, 2.0]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    assert trajectory.at([0.9, 2.1], tolerance=0.11)[:, 0].tolist() == [0.0, 1.0]
    for stamp in (0.9, 2.1, math.nan):
        with pytest.raises(ValueError, match="stamp"):
            trajectory.at([stamp], tolerance=0.05)
    with pytest.raises(ValueError, match="empty"):
        Trajectory(np.array([]), np.zeros((0, 3))).at([1.0])


def test_interpolation_copes_with_one_pose_and_with_equal_stamps():
    assert Trajectory(np.array([1.0]), np.array([[1.0, 2.0, 3.0]])).at([1.0])[0] == pytest.approx([1.0, 2.0, 3.0])
    trajectory = Trajectory(np.array([0.0, 1.0, 1.0, 2.0]), np.arange(12.0).reshape(4, 3) / 10)
    assert np.isfinite(trajectory.at([0.0, 1.0, 1.5, 2.0])).all()


def test_nearest_prefers_the_earlier_and_marks_what_is_too_far():
    trajectory = Trajectory(np.array([0.0, 1.0, 2.0]), np.zeros((3, 3)))
    assert trajectory.nearest([-0.4, 0.5, 0.6, 1.9, 2.4, 2.6, 9.0], 0.5).tolist() == [0, 0, 1, 2, 2, -1, -1]
    assert Trajectory(np.array([]), np.zeros((0, 3))).nearest([1.0], 1.0).tolist() == [-1]


@given(
    st.lists(st.floats(0, 10), min_size=1, max_size=20), st.lists(st.floats(-2, 12), max_size=20), st.floats(0.0, 3.0)
)
def test_nearest_is_nearest(stamps, wanted, tolerance):
    trajectory = Trajectory(np.sort(stamps), np.zeros((len(stamps), 3)))
    for stamp, index in zip(wanted, trajectory.nearest(wanted, tolerance), strict=True):
        least = np.abs(trajectory.stamps - stamp).min()
        if index < 0:
            assert least > tolerance
        else:
            assert abs(trajectory.stamps[index] - stamp) == least <= tolerance


def test_poses_of_one_stamp_follow_one_another_within_the_tick():
    poses = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
    trajectory = Trajectory(np.array([0.0, 1.0, 1.0, 1.0, 1.0, 2.0]), poses)
    assert trajectory.nearest([0.3, 0.55, 0.8, 1.0, 1.2, 1.45, 1.8], 0.5).tolist() == [0, 1, 2, 2, 3, 4, 5]
    np.testing.assert_allclose(separate_equal_stamps(trajectory.stamps, poses), [0.0, 0.625, 0.875, 1.125, 1.375, 2.0])


def test_stamps_that_tell_all_there_is_to_tell_are_kept():
    stamps = np.array([0.0, 1.0, 1.0, 1.0, 2.0])
    for poses in (np.zeros((5, 3)), np.repeat([[0.0], [1.0], [2.0]], [1, 3, 1], axis=0) * np.ones(3)):
        np.testing.assert_array_equal(separate_equal_stamps(stamps, poses), stamps)
    moving = np.arange(5.0)[:, None] * np.ones(3)
    np.testing.assert_array_equal(separate_equal_stamps(np.arange(5.0), moving), np.arange(5.0))
    np.testing.assert_array_equal(separate_equal_stamps(np.ones(5), moving), np.ones(5))
    assert separate_equal_stamps(np.empty(0), np.empty((0, 3))).size == 0


@given(
    st.integers(2, 12),
    st.lists(st.tuples(st.integers(1, 60), st.floats(0.0, 1.0)), min_size=1, max_size=20),
)
def test_a_record_is_found_again_by_its_true_stamp_though_the_log_rounds_it(most, bursts):
    """Bursts of records, as fast as a buffer is emptied, each begun at any moment, and a log that knows seconds only.

    Where a burst goes over the end of a tick its place there is known to a record at its beginning and its end, and
    where the counts of full ticks differ by one; within a tick it may be anywhere that the others of its tick leave.
    """
    begins = 1000.0 * np.arange(len(bursts) + 1) + np.array([0.0] + [begin for _, begin in bursts])
    counts = [4 * most] + [count for count, _ in bursts]
    true = np.concatenate([at + np.arange(n) / most for at, n in zip(begins, counts, strict=True)])
    rounded = np.floor(true + 0.5)
    trajectory = Trajectory(rounded, np.arange(len(true))[:, None] * np.ones(3))
    own = separate_equal_stamps(rounded, trajectory.poses)
    assert (np.diff(own) >= 0.0).all()
    assert (np.abs(own - rounded) <= 0.5).all()
    errors = trajectory.nearest(true, 0.6) - np.arange(len(true))
    burst = np.repeat(np.arange(len(counts)), counts)
    over_ticks = np.array([np.ptp(rounded[burst == k]) > 0.0 for k in range(len(counts))])[burst]
    alone = (most - np.array(counts)[burst]) / 2.0
    assert (np.abs(errors) <= np.where(over_ticks, 1.0, 1.0 + alone)).all()
