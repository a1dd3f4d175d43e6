"""Corrections of some poses carried to all records."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from features.se2 import between, compose, pose, wrap_angle
from slam.result import smoothing

seeds = st.integers(0, 10_000)
frames = st.builds(pose, st.floats(-50, 50), st.floats(-50, 50), st.floats(-math.pi, math.pi))


def carry_corrections(odom, nodes, corrected):
    """Carry corrections to records of equal intervals."""
    return smoothing.carry_corrections(odom, nodes, corrected, 0.1 * np.arange(len(odom)))


def drive(seed, count=30):
    rng = np.random.default_rng(seed)
    poses = [pose(*rng.normal(0.0, 3.0, 3))]
    for _ in range(count - 1):
        still = rng.random() < 0.2
        poses.append(poses[-1].copy() if still else compose(poses[-1], pose(*rng.normal([0.3, 0.0, 0.1], 0.2))))
    nodes = np.sort(rng.choice(count, rng.integers(1, 8), replace=False))
    return np.array(poses), nodes, rng


def moved(g, poses):
    return np.array([compose(g, each) for each in poses]).reshape(-1, 3)


def assert_same_poses(first, second, tolerance=1e-9):
    np.testing.assert_allclose(first[:, :2], second[:, :2], rtol=0, atol=tolerance)
    np.testing.assert_allclose(wrap_angle(first[:, 2] - second[:, 2]), 0.0, atol=tolerance)


@given(seeds)
def test_nodes_are_exact_and_headings_wrapped(seed):
    odom, nodes, rng = drive(seed)
    corrected = np.array([compose(odom[k], pose(*rng.normal(0.0, 0.5, 3))) for k in nodes])
    carried = carry_corrections(odom, nodes, corrected)
    assert carried.shape == odom.shape
    assert_same_poses(carried[nodes], corrected)
    assert (carried[:, 2] >= -math.pi).all()
    assert (carried[:, 2] <= math.pi).all()


@given(seeds)
def test_without_corrections_nothing_changes(seed):
    odom, nodes, _ = drive(seed)
    assert_same_poses(carry_corrections(odom, nodes, odom[nodes]), odom)


@given(seeds, frames)
def test_one_correction_for_all_moves_all(seed, g):
    odom, nodes, _ = drive(seed)
    assert_same_poses(carry_corrections(odom, nodes, moved(g, odom[nodes])), moved(g, odom))


@given(seeds, frames, frames)
def test_result_moves_with_the_world_and_not_with_the_odometry_frame(seed, g, h):
    odom, nodes, rng = drive(seed)
    corrected = np.array([compose(odom[k], pose(*rng.normal(0.0, 0.3, 3))) for k in nodes])
    assert_same_poses(
        carry_corrections(moved(h, odom), nodes, moved(g, corrected)),
        moved(g, carry_corrections(odom, nodes, corrected)),
    )


def test_before_the_first_and_after_the_last_anchor_odometry_alone_carries():
    odom, _, _ = drive(3)
    nodes = np.array([8, 20])
    corrected = np.array([pose(7.0, 7.0, 3.0), pose(-5.0, 1.0, -3.0)])
    carried = carry_corrections(odom, nodes, corrected)
    assert_same_poses(carried[:9], moved(corrected[0], [between(odom[8], each) for each in odom[:9]]))
    assert_same_poses(carried[20:], moved(corrected[1], [between(odom[20], each) for each in odom[20:]]))


def test_between_anchors_the_correction_grows_with_the_motion():
    odom = np.column_stack([[0.0, 1.0, 1.0, 1.0, 4.0, 10.0], np.zeros((6, 2))])
    corrected = np.array([[0.0, 0.0, 0.0], [10.0, 1.0, 0.0]])
    carried = carry_corrections(odom, np.array([0, 5]), corrected)
    np.testing.assert_allclose(carried[:, 0], odom[:, 0], atol=1e-9)
    np.testing.assert_allclose(carried[:, 1], [0.0, 0.1, 0.1, 0.1, 0.4, 1.0], atol=1e-8)


@given(seeds)
def test_blend_is_monotone(seed):
    """A correction to the side is taken over step by step and never taken back."""
    rng = np.random.default_rng(seed)
    ways = np.cumsum(rng.choice([0.0, 0.1, 1.0], 12))
    odom = np.column_stack([ways, np.zeros((12, 2))])
    carried = carry_corrections(odom, np.array([0, 11]), np.array([odom[0], odom[-1] + [0.0, 1.0, 0.0]]))
    assert (np.diff(carried[:, 1]) >= -1e-12).all()
    assert carried[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert carried[-1, 1] == pytest.approx(1.0)


def test_headings_are_blended_the_shorter_way_round():
    odom = np.column_stack([np.arange(3.0), np.zeros(3), np.full(3, 3.0)])
    corrected = np.array([[0.0, 0.0, 3.1], [2.0, 0.0, -3.1]])
    carried = carry_corrections(odom, np.array([0, 2]), corrected)
    assert abs(wrap_angle(carried[1, 2] - math.pi)) < 1e-9


def test_standing_still_the_correction_moves_on_with_the_time():
    """Records of one pose, on which two key frames disagree."""
    odom = np.tile(pose(1.0, 2.0, 0.5), (5, 1))
    corrected, stamps = odom[[0, 4]] + [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]], np.array([0.0, 0.1, 0.3, 0.3, 0.4])
    carried = smoothing.carry_corrections(odom, np.array([0, 4]), corrected, stamps)
    np.testing.assert_allclose(carried[:, 0] - 1.0, stamps, atol=1e-9)


def test_one_record_is_its_anchor():
    corrected = np.array([pose(5.0, 6.0, 7.0)])
    assert_same_poses(carry_corrections(np.zeros((1, 3)), np.array([0]), corrected), corrected)


def test_turning_on_the_spot_takes_its_share_of_the_correction():
    """A quarter of the turn takes a quarter of the correction, whatever the number of records."""
    turns = np.array([0.0, 0.25, 0.5, 0.6, 0.7, 1.0])
    odom = np.column_stack([np.zeros((6, 2)), turns])
    corrected = odom[[0, 5]] + [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]]
    carried = carry_corrections(odom, np.array([0, 5]), corrected)
    np.testing.assert_allclose(carried[:, 0], 0.2 * turns, atol=1e-8)
    np.testing.assert_allclose(carried[:, 2], turns, atol=1e-12)
