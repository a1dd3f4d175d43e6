"""Lists of lines and corners, and corners carried to the robot."""

import math

import numpy as np
import pytest
from finite_difference import finite_difference
from scenes import exact_scan, square

from features import Corners, LineForm, Mounting, Signatures, extract, sensor_preset

MOUNTINGS = [
    Mounting(),
    Mounting(0.2, -0.1, 2.0),
    Mounting(upside_down=True),
    Mounting(-0.15, 0.3, -1.1, upside_down=True),
]
with_each_mounting = pytest.mark.parametrize("mounting", MOUNTINGS)


@pytest.fixture(scope="module")
def features():
    return extract(exact_scan(square(turn=0.3, shift=(0.4, 0.1))), sensor_preset("rplidar-s1"))


@with_each_mounting
def test_covariances_are_carried_by_the_derivative_of_the_positions(features, mounting):
    corners, moved = features.corners, features.corners.to_robot(mounting)
    jacobian = finite_difference(mounting.points_to_robot, np.zeros(2))
    np.testing.assert_allclose(moved.positions, mounting.points_to_robot(corners.positions))
    np.testing.assert_allclose(moved.covs, jacobian @ corners.covs @ jacobian.T, rtol=1e-9, atol=1e-15)


@with_each_mounting
def test_a_turn_or_a_mirror_keeps_the_axes_of_the_error_ellipses(features, mounting):
    moved = features.corners.to_robot(mounting)
    np.testing.assert_allclose(np.linalg.eigvalsh(moved.covs), np.linalg.eigvalsh(features.corners.covs), rtol=1e-9)


@with_each_mounting
def test_signatures_are_carried(features, mounting):
    corners, moved = features.corners, features.corners.to_robot(mounting)
    for before, after in zip(corners, moved, strict=True):
        turned = mounting.direction_to_robot(before.orientation)
        assert math.cos(after.orientation - turned) == pytest.approx(1.0)
        assert (after.opening_angle, after.kind) == (before.opening_angle, before.kind)


def test_a_list_of_lines_gives_lines(features):
    lines = features.lines
    assert len(lines) == len(list(lines)) == 4
    for k, each in enumerate(lines):
        assert isinstance(each.form, LineForm)
        assert (each.form, each.center) == (lines.forms[k], lines.centers[k])
        np.testing.assert_array_equal(each.params, lines.params[k])
        np.testing.assert_array_equal(each.cov, lines.covs[k])
        np.testing.assert_array_equal([each.start, each.end], lines.ends[k])
        assert each.count == lines.counts[k]


def test_a_list_of_corners_gives_corners(features):
    corners = features.corners
    assert len(corners) == len(list(corners)) == 4
    for k, each in enumerate(corners):
        np.testing.assert_array_equal(each.position, corners.positions[k])
        np.testing.assert_array_equal(each.cov, corners.covs[k])
        assert (each.opening_angle, each.orientation) == (corners.opening_angles[k], corners.orientations[k])
        assert (each.kind, each.convex) == (corners.kinds[k], corners.convex[k])


def test_an_index_past_the_end_is_refused(features):
    with pytest.raises(IndexError):
        features.lines[4]
    with pytest.raises(IndexError):
        features.corners[4]


def test_no_corners_stay_no_corners_on_the_robot():
    none = Corners.of(np.empty((0, 2)), np.empty((0, 2, 2)), Signatures.of_points(0))
    moved = none.to_robot(MOUNTINGS[-1])
    assert len(moved) == 0
    assert moved.covs.shape == (0, 2, 2)
