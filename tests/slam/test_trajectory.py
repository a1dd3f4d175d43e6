import math
import tempfile
from pathlib import Path

import numpy as np
import pytest
from evo.core.trajectory import Plane
from evo.tools import file_interface
from hypothesis import given
from hypothesis import strategies as st

from features.errors import CwlfError
from features.se2 import wrap_angle
from slam.trajectory import Trajectory, TrajectoryFormatError, read_tum, told_apart, write_tum


def random_trajectory(seed, count=50):
    rng = np.random.default_rng(seed)
    stamps = 976052857.0 + np.sort(rng.uniform(0.0, 100.0, count)).round(6)
    poses = np.column_stack([rng.normal(0.0, 50.0, (count, 2)), rng.uniform(-math.pi, math.pi, count)])
    return Trajectory(stamps, poses)


def written(tmp_path, text):
    path = tmp_path / "run.tum"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


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


@given(st.integers(0, 2**32), st.integers(1, 20))
def test_tum_files_round_trip(seed, count):
    trajectory = random_trajectory(seed, count)
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder) / "1.tum", Path(folder) / "2.tum"
        write_tum(first, trajectory)
        read = read_tum(first)
        write_tum(second, trajectory)
        assert first.read_bytes() == second.read_bytes()
    # Half a digit of what is written; a heading is twice an arc tangent of two such numbers.
    np.testing.assert_allclose(read.stamps, trajectory.stamps, rtol=0, atol=6e-7)
    np.testing.assert_allclose(read.poses[:, :2], trajectory.poses[:, :2], rtol=0, atol=6e-10)
    assert np.abs(wrap_angle(read.poses[:, 2] - trajectory.poses[:, 2])).max() < 3e-9


def test_a_tum_file_has_the_known_format(tmp_path):
    write_tum(tmp_path / "run.tum", Trajectory(np.array([1.25]), np.array([[1.0, -2.0, math.pi / 2]])))
    expected = b"1.250000 1.000000000 -2.000000000 0 0 0 0.707106781 0.707106781\n"
    assert (tmp_path / "run.tum").read_bytes() == expected


def test_evo_reads_what_is_written(tmp_path):
    trajectory = random_trajectory(2)
    write_tum(tmp_path / "run.tum", trajectory)
    theirs = file_interface.read_tum_trajectory_file(str(tmp_path / "run.tum"))
    np.testing.assert_allclose(theirs.timestamps, trajectory.stamps, rtol=0, atol=6e-7)
    np.testing.assert_allclose(theirs.positions_xyz[:, :2], trajectory.poses[:, :2], rtol=0, atol=6e-10)
    yaw = theirs.get_orientations_euler("sxyz")[:, 2]
    assert np.abs(wrap_angle(yaw - trajectory.poses[:, 2])).max() < 3e-9


def test_rotations_in_space_are_projected_as_evo_does(tmp_path):
    rng = np.random.default_rng(3)
    table = np.column_stack([np.arange(30.0), rng.normal(size=(30, 3)), rng.normal(size=(30, 4))])
    table[:, 4:] /= np.linalg.norm(table[:, 4:], axis=1, keepdims=True)
    np.savetxt(tmp_path / "run.tum", table, fmt="%.12f", header="stamp x y z qx qy qz qw")
    theirs = file_interface.read_tum_trajectory_file(str(tmp_path / "run.tum"))
    theirs.project(Plane.XY)
    ours = read_tum(tmp_path / "run.tum")
    np.testing.assert_allclose(ours.poses[:, :2], theirs.positions_xyz[:, :2], atol=1e-12)
    yaw = theirs.get_orientations_euler("sxyz")[:, 2]
    assert np.abs(wrap_angle(ours.poses[:, 2] - yaw)).max() < 1e-8


GOOD = "0.0 1 2 0 0 0 0 1\n"


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "has no pose: expected lines"),
        ("# only a comment\n\n", "has no pose"),
        (GOOD + "# comment\n1.0 1 2 0 0 0 1\n", "line 3: 7 fields: expected `stamp x y z qx qy qz qw`"),
        (GOOD + "1.0 1 x 0 0 0 0 1\n", "line 2: 'x' is no finite number"),
        (GOOD + "1.0 1 nan 0 0 0 0 1\n", "line 2: 'nan' is no finite number"),
        (GOOD + "1.0 1 1_0 0 0 0 0 1\n", "line 2: '1_0' is no finite number"),
        (GOOD + "1.0 1 2 0 0 0 0 0\n", "line 2: quaternion is zero"),
        (GOOD + "-1.0 1 2 0 0 0 0 1\n", "line 2: stamp goes back by 1.000000 s"),
        (b"\xff\xfe", "is not text"),
    ],
)
def test_bad_tum_files_are_errors_that_name_the_line(tmp_path, text, cause):
    with pytest.raises(TrajectoryFormatError) as error:
        read_tum(written(tmp_path, text))
    assert "run.tum" in str(error.value)
    assert cause in str(error.value)


def test_tum_files_that_cannot_be_opened_are_errors(tmp_path):
    for path in (tmp_path, tmp_path / "absent.tum"):
        with pytest.raises(CwlfError, match="cannot be read"):
            read_tum(path)


def test_poses_of_one_stamp_follow_one_another_within_the_tick():
    poses = np.column_stack([np.arange(6.0), np.zeros(6), np.zeros(6)])
    trajectory = Trajectory(np.array([0.0, 1.0, 1.0, 1.0, 1.0, 2.0]), poses)
    assert trajectory.nearest([0.3, 0.55, 0.8, 1.0, 1.2, 1.45, 1.8], 0.5).tolist() == [0, 1, 2, 2, 3, 4, 5]
    np.testing.assert_allclose(told_apart(trajectory.stamps, poses), [0.0, 0.625, 0.875, 1.125, 1.375, 2.0])


def test_stamps_that_tell_all_there_is_to_tell_are_kept():
    stamps = np.array([0.0, 1.0, 1.0, 1.0, 2.0])
    for poses in (np.zeros((5, 3)), np.repeat([[0.0], [1.0], [2.0]], [1, 3, 1], axis=0) * np.ones(3)):
        np.testing.assert_array_equal(told_apart(stamps, poses), stamps)
    moving = np.arange(5.0)[:, None] * np.ones(3)
    np.testing.assert_array_equal(told_apart(np.arange(5.0), moving), np.arange(5.0))
    np.testing.assert_array_equal(told_apart(np.ones(5), moving), np.ones(5))
    assert told_apart(np.empty(0), np.empty((0, 3))).size == 0


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
    own = told_apart(rounded, trajectory.poses)
    assert (np.diff(own) >= 0.0).all()
    assert (np.abs(own - rounded) <= 0.5).all()
    errors = trajectory.nearest(true, 0.6) - np.arange(len(true))
    burst = np.repeat(np.arange(len(counts)), counts)
    over_ticks = np.array([np.ptp(rounded[burst == k]) > 0.0 for k in range(len(counts))])[burst]
    alone = (most - np.array(counts)[burst]) / 2.0
    assert (np.abs(errors) <= np.where(over_ticks, 1.0, 1.0 + alone)).all()
