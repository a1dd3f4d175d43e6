"""Sensor models check their numbers; mountings carry points, directions and poses alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import law

from features import SENSOR_PRESETS, Mounting, SensorModel, sensor_preset
from features.returns import is_return
from features.se2 import transform, wrap_angle

GOOD = {"sigma_range": 0.02, "sigma_bearing": 0.002, "range_min": 0.1, "range_max": 40.0}
MOUNTINGS = st.builds(
    Mounting,
    x=st.floats(-2.0, 2.0),
    y=st.floats(-2.0, 2.0),
    theta=st.floats(-math.pi, math.pi),
    upside_down=st.booleans(),
)


@pytest.mark.parametrize("name", ["sigma_range", "sigma_bearing"])
@pytest.mark.parametrize("value", [0.0, -0.01, math.nan, math.inf])
def test_a_standard_deviation_must_be_positive_and_finite(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value:g}: a standard deviation must be positive and finite"):
        SensorModel(**{**GOOD, name: value})


@pytest.mark.parametrize(
    ("low", "high"), [(-0.1, 40.0), (5.0, 5.0), (5.0, 1.0), (math.nan, 40.0), (0.1, math.nan), (math.inf, math.inf)]
)
def test_range_limits_must_be_in_order(low, high):
    with pytest.raises(ValueError, match="expected 0 <= range_min < range_max"):
        SensorModel(**{**GOOD, "range_min": low, "range_max": high})


def test_limits_may_start_at_zero_and_have_no_end():
    model = SensorModel(**{**GOOD, "range_min": 0.0, "range_max": math.inf})
    assert (model.range_min, model.range_max) == (0.0, math.inf)
    assert model.mounting == Mounting()


@law
@given(st.floats(0.0, 1.0), st.floats(1.5, 40.0), st.lists(st.floats(0.0, 50.0) | st.just(math.inf), min_size=1))
def test_a_return_is_positive_and_within_the_limits_compiled_or_not(low, high, ranges):
    model = SensorModel(**{**GOOD, "range_min": low, "range_max": high})
    measured = np.array([*ranges, 0.0, low, high, math.nextafter(high, math.inf), math.nextafter(low, -math.inf)])
    expected = [each > 0.0 and low <= each <= high for each in measured.tolist()]
    assert model.returned(measured).tolist() == expected
    assert is_return(measured, low, high).tolist() == expected
    assert [is_return(each, low, high) for each in measured.tolist()] == expected


def test_every_preset_is_found_by_its_name():
    for name, model in SENSOR_PRESETS.items():
        assert sensor_preset(name) is model


def test_an_unknown_preset_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"unknown sensor preset 'rplidar-s9': known are .*rplidar-s1.*, sick-lms"):
        sensor_preset("rplidar-s9")


@law
@given(MOUNTINGS, st.floats(-10.0, 10.0))
def test_points_and_directions_are_turned_alike(mounting, angle):
    """A point one metre along a direction lies, seen from the sensor's place, along the turned direction."""
    arm = mounting.points_to_robot(np.array([math.cos(angle), math.sin(angle)])) - [mounting.x, mounting.y]
    turned = mounting.direction_to_robot(angle)
    assert -math.pi <= turned <= math.pi
    np.testing.assert_allclose(arm, [math.cos(turned), math.sin(turned)], atol=1e-13)


@law
@given(MOUNTINGS, st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))
def test_one_point_is_carried_as_many_are(mounting, x, y):
    many = mounting.points_to_robot(np.array([[x, y], [0.0, 0.0]]))
    np.testing.assert_allclose(many[0], mounting.points_to_robot(np.array([x, y])), atol=1e-14)
    np.testing.assert_array_equal(many[1], [mounting.x, mounting.y])
    np.testing.assert_allclose(mounting.points_to_sensor(many), [[x, y], [0.0, 0.0]], atol=1e-14)


@law
@given(MOUNTINGS)
def test_the_axes_are_a_rotation_or_a_mirrored_one(mounting):
    np.testing.assert_allclose(mounting.axes @ mounting.axes.T, np.eye(2), atol=1e-15)
    assert np.linalg.det(mounting.axes) == pytest.approx(-1.0 if mounting.upside_down else 1.0)


def test_a_sensor_face_up_carries_points_as_its_pose_does():
    mounting = Mounting(0.3, -0.2, 2.5)
    points = np.array([[1.0, 2.0], [-3.0, 0.5]])
    np.testing.assert_allclose(
        mounting.points_to_robot(points), transform(mounting.pose_robot_sensor, points), atol=1e-15
    )


def test_upside_down_what_is_left_of_the_sensor_is_right_of_the_robot():
    mounting = Mounting(0.5, 0.0, 0.0, upside_down=True)
    np.testing.assert_allclose(mounting.points_to_robot(np.array([2.0, 1.0])), [2.5, -1.0])
    assert mounting.direction_to_robot(0.3) == pytest.approx(-0.3)


def test_upside_down_and_turned_the_sensor_is_mirrored_first():
    mounting = Mounting(0.0, 0.0, math.pi / 2.0, upside_down=True)
    np.testing.assert_allclose(mounting.points_to_robot(np.array([1.0, 2.0])), [2.0, 1.0], atol=1e-15)
    assert mounting.direction_to_robot(math.pi / 2.0) == pytest.approx(0.0)


@law
@given(st.floats(-10.0, 10.0))
def test_the_pose_of_a_mounting_has_a_wrapped_heading(theta):
    assert Mounting(1.0, 2.0, theta).pose_robot_sensor[2] == wrap_angle(theta)
