import itertools
import math

import numpy as np
import pytest
from evo.core import metrics as evo_metrics
from evo.core import sync
from evo.core.trajectory import PoseTrajectory3D
from hypothesis import given
from hypothesis import strategies as st
from walks import moved, random_pair

from features.errors import CwlfError
from features.se2 import between, pose
from slam.evaluation.metrics import (
    UnmatchedError,
    associate,
    ate,
    match_landmarks,
    rpe,
)
from slam.result.trajectory import Trajectory


def evo_trajectory(trajectory):
    half = trajectory.poses[:, 2] / 2
    zeros = np.zeros(len(trajectory))
    return PoseTrajectory3D(
        np.column_stack([trajectory.poses[:, :2], zeros]),
        np.column_stack([np.cos(half), zeros, zeros, np.sin(half)]),
        trajectory.stamps.copy(),
    )


def evo_pair(truth, estimate):
    return sync.associate_trajectories(evo_trajectory(truth), evo_trajectory(estimate), max_diff=0.02)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("swapped", [False, True])
def test_ate_is_that_of_evo(seed, swapped):
    truth, estimate = random_pair(seed)[:: -1 if swapped else 1]
    ours = ate(truth, estimate)
    reference, aligned = evo_pair(truth, estimate)
    aligned.align(reference)
    metric = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
    metric.process_data((reference, aligned))
    theirs = metric.get_all_statistics()
    assert ours.count == aligned.num_poses < len(estimate)
    assert ours.rmse_m == pytest.approx(theirs["rmse"], abs=1e-9)
    assert ours.mean_m == pytest.approx(theirs["mean"], abs=1e-9)
    assert ours.median_m == pytest.approx(theirs["median"], abs=1e-9)
    assert ours.max_m == pytest.approx(theirs["max"], abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("delta", "all_pairs"), [(1, False), (1, True), (7, False), (7, True)])
def test_rpe_is_that_of_evo(seed, delta, all_pairs):
    truth, estimate = random_pair(seed)
    ours = rpe(truth, estimate, delta=delta, all_pairs=all_pairs)
    theirs = {}
    for relation in (evo_metrics.PoseRelation.translation_part, evo_metrics.PoseRelation.rotation_angle_deg):
        metric = evo_metrics.RPE(relation, delta, evo_metrics.Unit.frames, all_pairs=all_pairs)
        metric.process_data(evo_pair(truth, estimate))
        theirs[relation.name] = metric.get_all_statistics()
        assert ours.count == metric.error.size
    assert ours.translation_rmse_m == pytest.approx(theirs["translation_part"]["rmse"], abs=1e-9)
    assert ours.translation_mean_m == pytest.approx(theirs["translation_part"]["mean"], abs=1e-9)
    assert ours.rotation_rmse_deg == pytest.approx(theirs["rotation_angle_deg"]["rmse"], abs=1e-9)
    assert ours.rotation_mean_deg == pytest.approx(theirs["rotation_angle_deg"]["mean"], abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_association_is_that_of_evo(seed):
    truth, estimate = random_pair(seed)
    ours = associate(truth, estimate)
    theirs = sync.matching_time_indices(estimate.stamps, truth.stamps, 0.02)
    assert [ours[1].tolist(), ours[0].tolist()] == [list(indices) for indices in theirs]


frames = st.builds(pose, st.floats(-100, 100), st.floats(-100, 100), st.floats(-math.pi, math.pi))


@pytest.mark.slow
@given(st.integers(0, 100), frames, frames)
def test_errors_do_not_depend_on_the_frames(seed, pose_a_truth, pose_b_estimate):
    truth, estimate = random_pair(seed, count=60)
    other_truth = Trajectory(truth.stamps, moved(truth.poses, pose_a_truth))
    other_estimate = Trajectory(estimate.stamps, moved(estimate.poses, pose_b_estimate))
    # Coordinates of up to 300 m, of which rounding leaves some 1e-13 m a sum.
    assert ate(other_truth, other_estimate).rmse_m == pytest.approx(ate(truth, estimate).rmse_m, abs=1e-9)
    first, second = rpe(other_truth, other_estimate), rpe(truth, estimate)
    assert first.translation_rmse_m == pytest.approx(second.translation_rmse_m, abs=1e-9)
    assert first.rotation_mean_deg == pytest.approx(second.rotation_mean_deg, abs=1e-9)


@given(st.integers(0, 100), frames)
def test_equal_trajectories_have_no_error_and_give_the_frame(seed, pose_truth_estimate):
    _, estimate = random_pair(seed, count=60)
    truth = Trajectory(estimate.stamps, moved(estimate.poses, pose_truth_estimate))
    error = ate(truth, estimate)
    assert error.count == len(truth)
    assert error.max_m == pytest.approx(0.0, abs=1e-9)
    assert between(error.pose_truth_estimate, pose_truth_estimate) == pytest.approx(np.zeros(3), abs=1e-9)
    relative = rpe(truth, estimate)
    assert max(relative.translation_rmse_m, relative.rotation_rmse_deg) == pytest.approx(0.0, abs=1e-9)


def test_one_pose_is_aligned_without_a_turn():
    truth = Trajectory(np.array([0.0]), np.array([[1.0, 2.0, 3.0]]))
    error = ate(truth, Trajectory(np.array([0.0]), np.array([[0.0, 0.0, 0.0]])))
    assert error.pose_truth_estimate == pytest.approx([1.0, 2.0, 0.0])
    assert (error.rmse_m, error.count) == (0.0, 1)


def test_what_does_not_overlap_in_time_is_an_error():
    truth, estimate = random_pair(0)
    later = Trajectory(estimate.stamps + 1000.0, estimate.poses)
    for function in (ate, rpe):
        with pytest.raises(CwlfError, match=r"no pose of the estimate \(170 poses, .* s\) is within 0.02 s"):
            function(truth, later)
    with pytest.raises(UnmatchedError, match="no poses"):
        ate(truth, Trajectory(np.array([]), np.zeros((0, 3))))
    with pytest.raises(UnmatchedError, match="expected at least 501"):
        rpe(truth, estimate, delta=500)
    with pytest.raises(ValueError, match="delta"):
        rpe(truth, estimate, delta=0)


@given(st.integers(0, 1000), st.integers(0, 5), st.integers(0, 5), st.floats(0.0, 4.0))
def test_landmarks_match_like_the_best_of_all_assignments(seed, count, other_count, max_distance):
    rng = np.random.default_rng(seed)
    truth, estimate = rng.uniform(0.0, 4.0, (count, 2)), rng.uniform(0.0, 4.0, (other_count, 2))
    pairs = match_landmarks(truth, estimate, max_distance)
    distances = np.linalg.norm(truth[:, None] - estimate[None], axis=2)
    assert pairs.shape[1] == 2
    assert len(set(pairs[:, 0])) == len(set(pairs[:, 1])) == len(pairs)
    assert (distances[pairs[:, 0], pairs[:, 1]] <= max_distance).all()
    size = min(count, other_count)
    best = (0, 0.0)
    for rows in itertools.combinations(range(count), size):
        for columns in itertools.permutations(range(other_count), size):
            near = [d for d in distances[list(rows), list(columns)] if d <= max_distance]
            best = min(best, (-len(near), sum(near)))
    assert -len(pairs) == best[0]
    assert distances[pairs[:, 0], pairs[:, 1]].sum() == pytest.approx(best[1], abs=1e-9)


def test_landmarks_of_other_shapes_are_refused():
    good = np.zeros((2, 2))
    for arguments in [(np.zeros(2), good, 1.0), (good, [[0.0, math.nan]], 1.0), (good, good, -1.0)]:
        with pytest.raises(ValueError, match="expected"):
            match_landmarks(*arguments)
