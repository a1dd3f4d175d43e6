"""Corners of two lines: position and covariance in the cases a, b and c of the paper."""

import numpy as np
import pytest
from finite_difference import finite_difference
from hypothesis import assume, given
from hypothesis import strategies as st

from features import Line, intersect

from . import extraction_twin
from .laws import law

CASES = {"a": (False, False), "b": (True, True), "c": (False, True), "c exchanged": (True, False)}


def line(vertical, slope, intercept, center, cov):
    return Line(vertical, slope, intercept, center, cov, start=np.zeros(2), end=np.ones(2), count=20)


def steepness(a, b):
    """Denominator of eq. 40-47."""
    return b.slope - a.slope if a.vertical == b.vertical else 1.0 - a.slope * b.slope


@st.composite
def covs(draw):
    """Covariance of slope and intercept, correlated or not."""
    sigmas = np.array([draw(st.floats(1e-4, 0.1)), draw(st.floats(1e-4, 0.1))])
    return np.outer(sigmas, sigmas) * np.array([[1.0, (rho := draw(st.floats(-0.95, 0.95)))], [rho, 1.0]])


@st.composite
def pairs(draw, vertical):
    parameters = st.tuples(st.floats(-1.5, 1.5), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), covs())
    a, b = (line(kind, *draw(parameters)) for kind in vertical)
    assume(abs(steepness(a, b)) > 0.2)
    return a, b


with_each_case = pytest.mark.parametrize("vertical", CASES.values(), ids=CASES.keys())


@with_each_case
@law
@given(data=st.data())
def test_corner_lies_on_both_lines(vertical, data):
    a, b = data.draw(pairs(vertical))
    (x, y), _ = intersect(a, b)
    for each in (a, b):
        u, v = (y, x) if each.vertical else (x, y)
        # Coordinates up to 100 m over a denominator of 0.2, each product rounded to 1e-16.
        assert v == pytest.approx(each.slope * (u - each.center) + each.intercept, abs=1e-11)


@with_each_case
@law
@given(data=st.data())
def test_covariance_is_propagated_by_the_finite_difference_jacobian(vertical, data):
    """Eq. 42, 45 and 48; the step is small against the denominator, whose inverse is differentiated."""
    a, b = data.draw(pairs(vertical))

    def position(parameters):
        moved = [
            line(each.vertical, parameters[2 * k], parameters[2 * k + 1], each.center, each.cov)
            for k, each in enumerate((a, b))
        ]
        return intersect(*moved)[0]

    at = [a.slope, a.intercept, b.slope, b.intercept]
    jacobian = finite_difference(position, at, step=1e-3 * abs(steepness(a, b)))
    joint = np.zeros((4, 4))
    joint[:2, :2], joint[2:, 2:] = a.cov, b.cov
    expected = jacobian @ joint @ jacobian.T
    np.testing.assert_allclose(intersect(a, b)[1], expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


@with_each_case
@law
@given(data=st.data())
def test_corner_equals_the_twin_that_solves_two_implicit_equations(vertical, data):
    a, b = data.draw(pairs(vertical))
    position, cov = intersect(a, b)
    expected_position, expected_cov = extraction_twin.intersect(a, b)
    np.testing.assert_allclose(position, expected_position, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(cov, expected_cov, rtol=0.0, atol=1e-11 * np.abs(expected_cov).max())


@with_each_case
@law
@given(data=st.data())
def test_covariance_is_symmetric_and_positive(vertical, data):
    _, cov = intersect(*data.draw(pairs(vertical)))
    assert cov[0, 1] == cov[1, 0]
    assert np.linalg.eigvalsh(cov)[0] > 0.0


@with_each_case
@law
@given(data=st.data())
def test_order_of_the_lines_does_not_matter(vertical, data):
    a, b = data.draw(pairs(vertical))
    position, cov = intersect(a, b)
    other_position, other_cov = intersect(b, a)
    np.testing.assert_allclose(position, other_position, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(cov, other_cov, rtol=0.0, atol=1e-11 * np.abs(cov).max())


def regressed_on_the_other_axis(given_line):
    """The same line and the same uncertainty, written as a regression of the other coordinate."""
    slope = given_line.slope
    by_parameters = np.diag([-1.0 / slope**2, -1.0 / slope])
    return line(
        not given_line.vertical,
        1.0 / slope,
        given_line.center,
        given_line.intercept,
        by_parameters @ given_line.cov @ by_parameters.T,
    )


@with_each_case
@law
@given(data=st.data())
def test_corner_does_not_depend_on_which_axis_was_regressed(vertical, data):
    """Cases a, b and c agree: each line is rewritten in turn."""
    a, b = data.draw(pairs(vertical))
    assume(min(abs(a.slope), abs(b.slope)) > 0.1)
    position, cov = intersect(a, b)
    for rewritten in (
        (regressed_on_the_other_axis(a), b),
        (a, regressed_on_the_other_axis(b)),
        (regressed_on_the_other_axis(a), regressed_on_the_other_axis(b)),
    ):
        other_position, other_cov = intersect(*rewritten)
        # Slopes down to 0.1 enter squared: two digits are lost on 1e-12.
        np.testing.assert_allclose(other_position, position, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(other_cov, cov, rtol=0.0, atol=1e-10 * np.abs(cov).max())


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ((False, 0.5), (False, 0.5)),
        ((True, -0.2), (True, -0.2)),
        ((False, 0.5), (True, 2.0)),
        ((True, 2.0), (False, 0.5)),
    ],
)
def test_parallel_lines_have_no_corner(a, b):
    cov = np.eye(2) * 1e-4
    with pytest.raises(ValueError, match="parallel lines have no intersection"):
        intersect(line(a[0], a[1], 1.0, 0.0, cov), line(b[0], b[1], 2.0, 0.0, cov))


def test_a_square_corner_takes_one_variance_from_each_wall():
    """y = 2 and x = 3, both fitted around their centres: the corner's covariance is written down at once."""
    floor = line(False, 0.0, 2.0, 1.0, np.diag([1e-4, 4e-4]))
    side = line(True, 0.0, 3.0, 1.0, np.diag([9e-4, 1e-6]))
    position, cov = intersect(floor, side)
    np.testing.assert_allclose(position, [3.0, 2.0])
    np.testing.assert_allclose(cov, [[1e-6 + 9e-4 * 1.0, 0.0], [0.0, 4e-4 + 1e-4 * 4.0]], atol=1e-18)
