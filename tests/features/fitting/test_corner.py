"""Corners of two lines: position and covariance in the cases a, b and c of the paper."""

import math

import extraction_twin
import numpy as np
import pytest
from finite_difference import finite_difference
from hypothesis import assume, given
from hypothesis import strategies as st
from laws import law

from features import Line, LineForm, intersect
from features.se2 import rotation

Y_ON_X, X_ON_Y, POLAR = LineForm
CASES = {
    "a": (Y_ON_X, Y_ON_X),
    "b": (X_ON_Y, X_ON_Y),
    "c": (Y_ON_X, X_ON_Y),
    "c exchanged": (X_ON_Y, Y_ON_X),
    "polar": (POLAR, POLAR),
}
REGRESSIONS = {name: forms for name, forms in CASES.items() if POLAR not in forms}


def line(form, slope, intercept, center, cov):
    """Of a polar line alpha and r take the places of slope and intercept."""
    return Line(form, np.array([slope, intercept]), center, cov, start=np.zeros(2), end=np.ones(2), count=20)


def steepness(a, b):
    """Denominator of eq. 36-37 or 40-47."""
    if a.form == POLAR:
        return math.sin(b.params[0] - a.params[0])
    return b.params[0] - a.params[0] if a.form == b.form else 1.0 - a.params[0] * b.params[0]


@st.composite
def covs(draw):
    """Covariance of slope and intercept, correlated or not."""
    sigmas = np.array([draw(st.floats(1e-4, 0.1)), draw(st.floats(1e-4, 0.1))])
    return np.outer(sigmas, sigmas) * np.array([[1.0, (rho := draw(st.floats(-0.95, 0.95)))], [rho, 1.0]])


@st.composite
def pairs(draw, forms):
    offsets = st.floats(-5.0, 5.0)
    regression = st.tuples(st.floats(-1.5, 1.5), offsets, offsets, covs())
    polar = st.tuples(st.floats(-math.pi, math.pi), offsets, st.just(0.0), covs())
    a, b = (line(form, *draw(polar if form == POLAR else regression)) for form in forms)
    assume(abs(steepness(a, b)) > 0.2)
    return a, b


with_each_case = pytest.mark.parametrize("forms", CASES.values(), ids=CASES.keys())
with_each_regression = pytest.mark.parametrize("forms", REGRESSIONS.values(), ids=REGRESSIONS.keys())


@pytest.mark.slow
@with_each_case
@law
@given(data=st.data())
def test_corner_lies_on_both_lines(forms, data):
    a, b = data.draw(pairs(forms))
    (x, y), _ = intersect(a, b)
    for each in (a, b):
        first, second = each.params
        # Coordinates up to 100 m over a denominator of 0.2, each product rounded to 1e-16.
        if each.form == POLAR:
            assert x * math.cos(first) + y * math.sin(first) == pytest.approx(second, abs=1e-11)
        else:
            u, v = (y, x) if each.form == X_ON_Y else (x, y)
            assert v == pytest.approx(first * (u - each.center) + second, abs=1e-11)


@with_each_case
@law
@given(data=st.data())
def test_covariance_is_propagated_by_the_finite_difference_jacobian(forms, data):
    """Eq. 38, 42, 45 and 48; the step is small against the denominator, whose inverse is differentiated."""
    a, b = data.draw(pairs(forms))

    def position(parameters):
        moved = [
            line(each.form, parameters[2 * k], parameters[2 * k + 1], each.center, each.cov)
            for k, each in enumerate((a, b))
        ]
        return intersect(*moved)[0]

    at = np.concatenate([a.params, b.params])
    jacobian = finite_difference(position, at, step=1e-3 * abs(steepness(a, b)))
    joint = np.zeros((4, 4))
    joint[:2, :2], joint[2:, 2:] = a.cov, b.cov
    expected = jacobian @ joint @ jacobian.T
    np.testing.assert_allclose(intersect(a, b)[1], expected, rtol=0.0, atol=1e-8 * np.abs(expected).max())


@with_each_case
@law
@given(data=st.data())
def test_corner_equals_the_twin_that_solves_two_implicit_equations(forms, data):
    a, b = data.draw(pairs(forms))
    position, cov = intersect(a, b)
    expected_position, expected_cov = extraction_twin.intersect(a, b)
    np.testing.assert_allclose(position, expected_position, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(cov, expected_cov, rtol=0.0, atol=1e-11 * np.abs(expected_cov).max())


@with_each_case
@law
@given(data=st.data())
def test_covariance_is_symmetric_and_positive(forms, data):
    _, cov = intersect(*data.draw(pairs(forms)))
    assert cov[0, 1] == cov[1, 0]
    assert np.linalg.eigvalsh(cov)[0] > 0.0


@pytest.mark.slow
@with_each_case
@law
@given(data=st.data())
def test_order_of_the_lines_does_not_matter(forms, data):
    a, b = data.draw(pairs(forms))
    position, cov = intersect(a, b)
    other_position, other_cov = intersect(b, a)
    np.testing.assert_allclose(position, other_position, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(cov, other_cov, rtol=0.0, atol=1e-11 * np.abs(cov).max())


def regressed_on_the_other_axis(given_line):
    """The same line and the same uncertainty, written as a regression of the other coordinate."""
    slope, intercept = given_line.params
    by_parameters = np.diag([-1.0 / slope**2, -1.0 / slope])
    return line(
        X_ON_Y if given_line.form == Y_ON_X else Y_ON_X,
        1.0 / slope,
        given_line.center,
        intercept,
        by_parameters @ given_line.cov @ by_parameters.T,
    )


@pytest.mark.slow
@with_each_regression
@law
@given(data=st.data())
def test_corner_does_not_depend_on_which_axis_was_regressed(forms, data):
    """Cases a, b and c agree: each line is rewritten in turn."""
    a, b = data.draw(pairs(forms))
    assume(min(abs(a.params[0]), abs(b.params[0])) > 0.1)
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


def as_regression(polar_line, form, center):
    """A polar line as a regression, its covariance through the derivative of (slope, intercept) by (alpha, r)."""

    def regression(params):
        c, s = math.cos(params[0]), math.sin(params[0])
        (nu, nv), r = ((s, c) if form == X_ON_Y else (c, s)), params[1]
        return np.array([-nu / nv, (r - nu * center) / nv])

    # Normals that are 0.4 or more of the divisor: the fifth derivative over a step of 1e-3 leaves 1e-9 of the first.
    jacobian = finite_difference(regression, polar_line.params)
    return line(form, *regression(polar_line.params), center, jacobian @ polar_line.cov @ jacobian.T)


@with_each_regression
@law
@given(data=st.data())
def test_corner_of_polar_lines_is_that_of_the_same_lines_as_regressions(forms, data):
    """Eq. 36-39 against eq. 40-48: position and covariance, whatever the centre."""
    offsets = st.floats(-5.0, 5.0)
    flattest = {X_ON_Y: st.sampled_from([0.0, math.pi]), Y_ON_X: st.sampled_from([-math.pi / 2.0, math.pi / 2.0])}
    a, b = (
        line(POLAR, data.draw(flattest[form]) + data.draw(st.floats(-1.15, 1.15)), *data.draw(positions))
        for form, positions in zip(forms, [st.tuples(offsets, st.just(0.0), covs())] * 2, strict=True)
    )
    assume(abs(steepness(a, b)) > 0.2)
    rewritten = [as_regression(each, form, data.draw(offsets)) for each, form in zip((a, b), forms, strict=True)]
    position, cov = intersect(a, b)
    other_position, other_cov = intersect(*rewritten)
    np.testing.assert_allclose(other_position, position, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(other_cov, cov, rtol=0.0, atol=1e-7 * np.abs(cov).max())


@law
@given(data=st.data(), turn=st.floats(-math.pi, math.pi))
def test_a_corner_of_polar_lines_turns_with_the_frame(data, turn):
    a, b = data.draw(pairs((POLAR, POLAR)))
    position, cov = intersect(a, b)
    turned = [line(POLAR, each.params[0] + turn, each.params[1], 0.0, each.cov) for each in (a, b)]
    turned_position, turned_cov = intersect(*turned)
    np.testing.assert_allclose(turned_position, rotation(turn) @ position, atol=1e-11)
    np.testing.assert_allclose(
        turned_cov, rotation(turn) @ cov @ rotation(turn).T, rtol=0.0, atol=1e-11 * np.abs(cov).max()
    )


def test_either_direction_of_a_normal_is_the_same_line():
    """r < 0 with the opposite normal: not what a fit gives, but the same corner."""
    cov = np.array([[1e-4, 2e-5], [2e-5, 4e-4]])
    side = line(POLAR, 0.1, 2.0, 0.0, np.eye(2) * 1e-4)
    one, other = line(POLAR, 1.3, 1.5, 0.0, cov), line(POLAR, 1.3 - math.pi, -1.5, 0.0, cov * [[1, -1], [-1, 1]])
    for found, expected in zip(intersect(other, side), intersect(one, side), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("form", [Y_ON_X, X_ON_Y])
def test_a_polar_line_and_a_regression_are_refused(form):
    cov = np.eye(2) * 1e-4
    a, b = line(POLAR, 0.3, 1.0, 0.0, cov), line(form, 0.5, 1.0, 0.0, cov)
    for pair in ((a, b), (b, a)):
        with pytest.raises(ValueError, match="a polar line and a regression line: fit both by the same method"):
            intersect(*pair)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ((Y_ON_X, 0.5), (Y_ON_X, 0.5)),
        ((X_ON_Y, -0.2), (X_ON_Y, -0.2)),
        ((Y_ON_X, 0.5), (X_ON_Y, 2.0)),
        ((X_ON_Y, 2.0), (Y_ON_X, 0.5)),
        ((POLAR, 0.5), (POLAR, 0.5)),
    ],
)
def test_parallel_lines_have_no_corner(a, b):
    cov = np.eye(2) * 1e-4
    with pytest.raises(ValueError, match="parallel lines have no intersection"):
        intersect(line(a[0], a[1], 1.0, 0.0, cov), line(b[0], b[1], 2.0, 0.0, cov))


def test_a_square_corner_takes_one_variance_from_each_wall():
    """y = 2 and x = 3, both fitted around their centres: the corner's covariance is written down at once."""
    floor = line(Y_ON_X, 0.0, 2.0, 1.0, np.diag([1e-4, 4e-4]))
    side = line(X_ON_Y, 0.0, 3.0, 1.0, np.diag([9e-4, 1e-6]))
    position, cov = intersect(floor, side)
    np.testing.assert_allclose(position, [3.0, 2.0])
    np.testing.assert_allclose(cov, [[1e-6 + 9e-4 * 1.0, 0.0], [0.0, 4e-4 + 1e-4 * 4.0]], atol=1e-18)
