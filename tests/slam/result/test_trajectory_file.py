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
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import TrajectoryFormatError, read_trajectory_file, write_tum


def random_trajectory(seed, count=50):
    rng = np.random.default_rng(seed)
    stamps = 976052857.0 + np.sort(rng.uniform(0.0, 100.0, count)).round(6)
    poses = np.column_stack([rng.normal(0.0, 50.0, (count, 2)), rng.uniform(-math.pi, math.pi, count)])
    return Trajectory(stamps, poses)


def written(tmp_path, text):
    path = tmp_path / "run.tum"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@given(st.integers(0, 2**32), st.integers(1, 20))
def test_tum_files_round_trip(seed, count):
    trajectory = random_trajectory(seed, count)
    with tempfile.TemporaryDirectory() as folder:
        first, second = Path(folder) / "1.tum", Path(folder) / "2.tum"
        write_tum(first, trajectory)
        read = read_trajectory_file(first)
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
    ours = read_trajectory_file(tmp_path / "run.tum")
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
        ("0.0 1 2\n", "line 1: 3 fields: expected `stamp x y z qx qy qz qw` or `stamp x y theta`"),
        ("0.0 1 2 3\n1.0 1 2 3 0 0 0 1\n", "line 2: 8 fields: expected `stamp x y theta`"),
        (b"\xff\xfe", "is not text"),
    ],
)
def test_bad_tum_files_are_errors_that_name_the_line(tmp_path, text, cause):
    with pytest.raises(TrajectoryFormatError) as error:
        read_trajectory_file(written(tmp_path, text))
    assert "run.tum" in str(error.value)
    assert cause in str(error.value)


def test_tum_files_that_cannot_be_opened_are_errors(tmp_path):
    for path in (tmp_path, tmp_path / "absent.tum"):
        with pytest.raises(CwlfError, match="cannot be read"):
            read_trajectory_file(path)


def test_planar_poses_are_those_of_the_same_trajectory_in_space(tmp_path):
    trajectory = random_trajectory(5)
    turned = trajectory.poses + np.array([0.0, 0.0, 2.0 * math.pi])
    rows = np.column_stack([trajectory.stamps, turned])
    np.savetxt(tmp_path / "planar.txt", rows, "%.9f", header="stamp x y theta")
    write_tum(tmp_path / "run.tum", trajectory)
    planar, in_space = read_trajectory_file(tmp_path / "planar.txt"), read_trajectory_file(tmp_path / "run.tum")
    np.testing.assert_array_equal(planar.stamps, in_space.stamps)
    np.testing.assert_allclose(planar.poses, in_space.poses, atol=1e-8)
