"""Group laws of SE(2), its Jacobians and the one place where angles are wrapped."""

import math

import numpy as np
import pytest
from finite_difference import assert_jacobian
from hypothesis import example, given
from hypothesis import strategies as st
from laws import law

from features.se2 import (
    align,
    between,
    compose,
    compose_each,
    compose_jacobians,
    inverse,
    pose,
    rotate_each,
    rotation,
    transform,
    transform_inverse,
    wrap_angle,
)
from features.se2_kernels import compound

COORDINATES = st.floats(-100.0, 100.0)
HEADINGS = st.one_of(
    st.floats(-math.pi, math.pi),
    # Near the cut and near zero, where wrapping goes wrong first.
    st.sampled_from([-math.pi, math.pi, 0.0]).flatmap(lambda a: st.floats(-1e-9, 1e-9).map(lambda d: a + d)),
)
POSES = st.builds(pose, COORDINATES, COORDINATES, HEADINGS)
POINTS = st.tuples(COORDINATES, COORDINATES).map(np.array)
ROUNDING = 1e-11
"""A few products of numbers up to 200, each rounded to 1e-16 of itself."""


def difference(pose_a, pose_b):
    apart = pose_a - pose_b
    apart[2] = wrap_angle(apart[2])
    return apart


def assert_same_pose(pose_a, pose_b):
    np.testing.assert_allclose(difference(pose_a, pose_b), 0.0, atol=ROUNDING)


@law
@given(POSES, POSES, POSES)
def test_composition_is_associative(a, b, c):
    assert_same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))


@law
@given(POSES)
def test_the_identity_changes_nothing(a):
    assert_same_pose(compose(a, pose()), a)
    assert_same_pose(compose(pose(), a), a)


@law
@given(POSES)
def test_a_pose_and_its_inverse_cancel(a):
    assert_same_pose(compose(a, inverse(a)), pose())
    assert_same_pose(compose(inverse(a), a), pose())


@law
@given(POSES, POSES)
def test_between_undoes_composition(a, b):
    assert_same_pose(between(a, compose(a, b)), b)
    assert_same_pose(between(a, b), compose(inverse(a), b))


@law
@given(POSES, POSES, POINTS)
def test_transforming_twice_is_transforming_by_the_composition(a, b, point):
    np.testing.assert_allclose(transform(a, transform(b, point)), transform(compose(a, b), point), atol=ROUNDING)


@law
@given(POSES, POINTS)
def test_transform_moves_one_point_as_it_moves_many(a, point):
    many = transform(a, np.stack([point, 2.0 * point]))
    assert many.shape == (2, 2)
    np.testing.assert_allclose(many[0], transform(a, point), atol=ROUNDING)


@law
@given(POSES, POINTS)
def test_transform_agrees_with_the_translation_of_a_composition(a, point):
    np.testing.assert_allclose(transform(a, point), compose(a, pose(*point))[:2], atol=ROUNDING)


@law
@given(POSES, POINTS)
def test_the_inverse_transform_takes_a_point_back(a, point):
    np.testing.assert_allclose(transform_inverse(a, transform(a, point)), point, atol=ROUNDING)
    np.testing.assert_allclose(transform_inverse(a, point), transform(inverse(a), point), atol=ROUNDING)


@law
@given(st.lists(st.tuples(HEADINGS, POINTS), min_size=1, max_size=4))
def test_each_point_is_rotated_by_its_own_angle(rows):
    angles, points = np.array([angle for angle, _ in rows]), np.array([point for _, point in rows])
    expected = [rotation(angle) @ point for angle, point in rows]
    np.testing.assert_allclose(rotate_each(points, angles), expected, atol=ROUNDING)
    np.testing.assert_allclose(rotate_each(points, angles[0]), points @ rotation(angles[0]).T, atol=ROUNDING)


@law
@given(st.lists(st.tuples(POSES, POSES), min_size=1, max_size=4))
def test_poses_are_composed_row_by_row(pairs):
    first, second = np.array(pairs).transpose(1, 0, 2)
    for composed, (a, b) in zip(compose_each(first, second), pairs, strict=True):
        assert_same_pose(composed, compose(a, b))


@law
@given(st.integers(0, 2**32 - 1), POSES)
def test_no_other_alignment_is_better(seed, other):
    rng = np.random.default_rng(seed)
    truth, estimate = rng.normal(0.0, 3.0, (2, 6, 2))

    def cost(pose_truth_estimate):
        return np.sum((transform(pose_truth_estimate, estimate) - truth) ** 2)

    best = align(truth, estimate)
    assert cost(best) <= cost(compose(best, 1e-3 * other)) + 1e-12
    assert cost(best) <= cost(other) + 1e-12


@law
@given(st.integers(0, 2**32 - 1), POSES, POSES)
def test_an_uncertain_pose_is_compounded_by_the_jacobians_of_the_composition(seed, a, motion):
    """Of the pose jointly with a landmark that stands still: its covariance, and that with the landmark."""
    rng = np.random.default_rng(seed)
    root, motion_root = rng.normal(0.0, 0.1, (5, 5)), rng.normal(0.0, 0.1, (3, 3))
    joint, motion_cov = root @ root.T, motion_root @ motion_root.T
    by_pose, by_motion = compose_jacobians(a, motion)
    crosses = joint[None, :3, 3:].copy()
    moved, cov, finite = compound(a, joint[:3, :3].copy(), crosses, motion, motion_cov)
    assert finite
    assert_same_pose(moved, compose(a, motion))
    expected = by_pose @ joint[:3, :3] @ by_pose.T + by_motion @ motion_cov @ by_motion.T
    np.testing.assert_allclose(cov, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(crosses[0], by_pose @ joint[:3, 3:], rtol=1e-9, atol=1e-9)


@law
@given(HEADINGS)
def test_rotation_is_orthogonal_and_turns_counter_clockwise(theta):
    np.testing.assert_allclose(rotation(theta) @ rotation(theta).T, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(rotation(theta) @ [1.0, 0.0], [math.cos(theta), math.sin(theta)], atol=1e-15)


@law
@given(POSES, POSES)
def test_headings_are_wrapped(a, b):
    for heading in (compose(a, b)[2], inverse(a)[2], between(a, b)[2]):
        assert -math.pi <= heading <= math.pi


@law
@given(st.floats(-1e3, 1e3))
@example(math.pi)
@example(-math.pi)
@example(3.0 * math.pi)
def test_a_wrapped_angle_is_the_same_direction_in_the_half_open_turn(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    # 1e3 rad is rounded to 1e-13 rad.
    assert math.isclose(math.cos(wrapped - angle), 1.0, abs_tol=1e-13)
    assert abs(math.sin(wrapped - angle)) < 1e-12


def test_wrapping_an_array_wraps_each_angle():
    angles = np.array([-7.0, -math.pi, 0.0, 3.0, math.pi, 10.0])
    np.testing.assert_array_equal(wrap_angle(angles), [wrap_angle(float(angle)) for angle in angles])


def test_an_angle_just_below_minus_pi_wraps_into_the_half_open_turn():
    assert wrap_angle(math.nextafter(-math.pi, -4.0)) < math.pi


@law
@given(POSES, POSES)
def test_jacobians_of_the_composition_are_its_derivatives(a, b):
    by_first, by_second = compose_jacobians(a, b)
    assert_jacobian(by_first, lambda x: compose(x, b), a, difference=difference)
    assert_jacobian(by_second, lambda x: compose(a, x), b, difference=difference)


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf])
def test_what_is_no_angle_is_not_made_one(angle):
    assert math.isnan(wrap_angle(angle))
    with np.errstate(invalid="ignore"):
        assert np.isnan(wrap_angle(np.array([0.0, angle]))).tolist() == [False, True]
    assert math.isnan(pose(0.0, 0.0, angle)[2])
