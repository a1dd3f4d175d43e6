import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from places import DATA
from walks import moved, random_pair

from drivers.carmen.log import CarmenLog
from features.errors import CwlfError
from features.se2 import between, pose
from slam.evaluation.relations import Relations, RelationsFormatError, read_relations, relations
from slam.result.trajectory import Trajectory

frames = st.builds(pose, st.floats(-100, 100), st.floats(-100, 100), st.floats(-math.pi, math.pi))


def all_relations(truth, step):
    pairs = list(itertools.permutations(range(0, len(truth), step), 2))
    starts, ends = np.array(pairs).T
    return Relations(
        truth.stamps[starts], truth.stamps[ends], np.array([between(truth.poses[i], truth.poses[j]) for i, j in pairs])
    )


def test_relations_measure_the_difference_of_the_motions():
    truth = Relations(
        np.array([0.0, 1.0, 5.0]), np.array([1.0, 2.0, 0.0]), np.array([[1.0, 0, 0], [0.0, 0, 0], [0, 0, 0]])
    )
    estimate = Trajectory(np.array([0.04, 1.0, 2.0]), np.array([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0], [0.0, 3.0, -3.0]]))
    error = relations(truth, estimate)
    turn = math.degrees(2 * math.pi - 6.0)
    assert (error.count, error.uncounted) == (2, 1)
    assert error.translation_mean_m == pytest.approx(2.0)
    assert error.translation_std_m == pytest.approx(1.0)
    assert error.rotation_mean_deg == pytest.approx(turn / 2)
    assert error.rotation_std_deg == pytest.approx(turn / 2)


@given(st.integers(0, 100), frames)
def test_relation_errors_do_not_depend_on_the_frame(seed, pose_b_estimate):
    truth, estimate = random_pair(seed, count=60)
    other_estimate = Trajectory(estimate.stamps, moved(estimate.poses, pose_b_estimate))
    true_relations = all_relations(truth, 6)
    first, second = (relations(true_relations, each, tolerance=0.5) for each in (other_estimate, estimate))
    assert first.translation_mean_m == pytest.approx(second.translation_mean_m, abs=1e-9)
    assert first.rotation_std_deg == pytest.approx(second.rotation_std_deg, abs=1e-9)


def test_relations_of_the_truth_are_without_error():
    truth, _ = random_pair(4)
    error = relations(all_relations(truth, 20), truth)
    assert max(error.translation_mean_m, error.rotation_mean_deg) == pytest.approx(0.0, abs=1e-9)
    assert error.uncounted == 0


def test_relations_are_read(tmp_path):
    path = tmp_path / "run.relations"
    path.write_text("# comment\n1.5 2.5 1 2 9 8 7 -3\n\n")
    read = read_relations(path)
    assert (read.stamps_from.tolist(), read.stamps_to.tolist()) == ([1.5], [2.5])
    assert read.poses_from_to.tolist() == [[1.0, 2.0, -3.0]]


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (b"", "has no relation"),
        (b"# c\n1 2 3\n", "line 2: 3 fields: expected `t1 t2 x y z roll pitch yaw`"),
        (b"1 2 3 4 5 6 7 x\n", "line 1: 'x' is no finite number"),
        (b"1 2 3 4 5 6 7 inf\n", "line 1: 'inf' is no finite number"),
        (b"\0\xff", "is not text"),
    ],
)
def test_bad_relations_are_errors_that_name_the_line(tmp_path, content, cause):
    path = tmp_path / "run.relations"
    path.write_bytes(content)
    with pytest.raises(RelationsFormatError) as error:
        read_relations(path)
    assert "run.relations" in str(error.value)
    assert cause in str(error.value)
    with pytest.raises(RelationsFormatError, match="cannot be read"):
        read_relations(tmp_path)


def test_relations_of_other_shapes_are_refused():
    with pytest.raises(ValueError, match="expected"):
        Relations(np.zeros(2), np.zeros(2), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="finite"):
        Relations(np.zeros(1), np.array([math.nan]), np.zeros((1, 3)))


def test_relations_that_no_pose_is_near_are_an_error():
    truth, estimate = random_pair(0)
    later = Trajectory(estimate.stamps + 1000.0, estimate.poses)
    with pytest.raises(CwlfError, match=r"none of \d+ relations"):
        relations(all_relations(truth, 10), later)


@pytest.mark.slow
def test_the_odometry_of_the_intel_log_has_its_known_error():
    log, truth = DATA / "intel-lab.clf.gz", DATA / "intel-lab.relations"
    if not (log.is_file() and truth.is_file()):
        pytest.skip(f"{log} or {truth} is absent: set CWLF_DATA to the folder of the real logs")
    read = list(CarmenLog(log))
    odometry = Trajectory(
        np.array([frame.stamp for frame in read]), np.array([frame.pose_odom_robot for frame in read])
    )
    error = relations(read_relations(truth), odometry)
    assert (error.count, error.uncounted) == (2984, 0)
    assert error.translation_mean_m == pytest.approx(7.38, abs=0.01)
    assert error.translation_std_m == pytest.approx(14.3, abs=0.05)
    # Thousands of records share their stamp with another of a different pose; which of them stands for it moves the
    # mean between 39.4 and 39.6 deg.
    assert error.rotation_mean_deg == pytest.approx(39.3, abs=0.3)
