"""Line fits: the estimate of eq. 20-30, the paper's covariance and the propagated one, against independent oracles."""

import math

import numpy as np
import pytest
from finite_difference import finite_difference
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import minimize

from features import DegenerateSegmentError, SensorModel, fit_cwlf, sensor_preset
from features.line_fit import misfit_scale

from .extraction_twin import cartesian_cov, fit_line
from .laws import law

MODEL = sensor_preset("rplidar-s1")
FORMS = ["propagated", "paper"]


def polar(points):
    return np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])


def wall(normal_angle, distance, start, length, count):
    """Points on a straight wall at a distance from the sensor."""
    along = np.array([-np.sin(normal_angle), np.cos(normal_angle)])
    foot = distance * np.array([np.cos(normal_angle), np.sin(normal_angle)])
    return foot + np.linspace(start, start + length, count)[:, None] * along


@st.composite
def segments(draw, sigma=0.03, least=2):
    """Polar points of a rough wall in any direction, 2 to 150 of them."""
    points = wall(
        draw(st.floats(-math.pi, math.pi)),
        draw(st.floats(0.3, 10.0)),
        draw(st.floats(-5.0, 4.0)),
        draw(st.floats(0.3, 6.0)),
        draw(st.integers(least, 150)),
    )
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = points + draw(st.floats(0.0, sigma)) * rng.standard_normal(points.shape)
    # Where both axes spread alike to the last digit, which one is regressed is a matter of rounding.
    spread = ((points - points.mean(axis=0)) ** 2).sum(axis=0)
    assume(abs(spread[0] - spread[1]) > 1e-9 * spread.sum())
    return polar(points)


@st.composite
def models(draw):
    return SensorModel(draw(st.floats(0.001, 0.05)), draw(st.floats(1e-4, 1e-2)), 0.1, 40.0)


def squared_errors(line, ranges, angles, model, slope, intercept):
    """Eq. 24, its weights literally eq. 23 or 34."""
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    if line.vertical:
        w = np.sin(angles) ** 2 / (ranges * model.sigma_bearing) ** 2 + np.cos(angles) ** 2 / model.sigma_range**2
        return w, y, (w * (x - slope * (y - line.center) - intercept) ** 2).sum()
    w = np.cos(angles) ** 2 / (ranges * model.sigma_bearing) ** 2 + np.sin(angles) ** 2 / model.sigma_range**2
    return w, x, (w * (y - slope * (x - line.center) - intercept) ** 2).sum()


@pytest.mark.parametrize("form", FORMS)
@law
@given(segment=segments(), model=models())
def test_fit_equals_the_twin_written_with_matrices(form, segment, model):
    """To 1e-9 of each number, or of its scale where it may vanish: slope 1, lengths 1 m, covariance its variances."""
    ranges, angles = segment
    line = fit_cwlf(ranges, angles, model, form)
    vertical, slope, intercept, center, cov, ends = fit_line(
        ranges, angles, model.sigma_range, model.sigma_bearing, form
    )
    assert line.vertical == vertical
    assert line.count == len(ranges)
    np.testing.assert_allclose(
        [line.slope, line.intercept, line.center], [slope, intercept, center], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(np.diag(line.cov), np.diag(cov), rtol=1e-9)
    np.testing.assert_allclose(
        line.cov, cov, rtol=0.0, atol=1e-9 * math.sqrt(cov[0, 0] * cov[1, 1]) + 1e-9 * np.diag(cov).min()
    )
    np.testing.assert_allclose([line.start, line.end], ends, atol=1e-9)


@law
@given(segment=segments(), model=models())
def test_paper_form_is_equation_31_and_32(segment, model):
    ranges, angles = segment
    line = fit_cwlf(ranges, angles, model, "paper")
    w, u, _ = squared_errors(line, ranges, angles, model, line.slope, line.intercept)
    xi = u - (w * u).sum() / w.sum()
    np.testing.assert_allclose(np.diag(line.cov), [1.0 / (w * xi**2).sum(), 1.0 / w.sum()], rtol=1e-9)
    assert line.cov[0, 1] == line.cov[1, 0] == 0.0


@law
@given(segment=segments(), model=models())
def test_estimate_is_equation_25_and_26_at_the_centroid(segment, model):
    ranges, angles = segment
    line = fit_cwlf(ranges, angles, model)
    w, u, _ = squared_errors(line, ranges, angles, model, line.slope, line.intercept)
    v = ranges * (np.cos(angles) if line.vertical else np.sin(angles))
    total = w.sum()
    slope = (w @ (u * v) - (w @ u) * (w @ v) / total) / (w @ (u * u) - (w @ u) ** 2 / total)
    # Eq. 25 subtracts numbers up to 1e4 times larger than their difference, of which 1e-16 is rounded.
    np.testing.assert_allclose(line.slope, slope, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(
        line.intercept - line.slope * line.center, w @ v / total - slope * (w @ u) / total, atol=1e-7
    )


@pytest.mark.parametrize("normal_angle", [0.0, 0.5, 1.2, 2.0, -2.5])
def test_estimate_minimises_the_weighted_squared_errors(normal_angle):
    """scipy, started elsewhere, finds the same minimum of eq. 24; its own accuracy in the parameters is about 1e-7."""
    rng = np.random.default_rng(3)
    ranges, angles = polar(wall(normal_angle, 2.0, -1.0, 3.0, 60) + 0.02 * rng.standard_normal((60, 2)))
    line = fit_cwlf(ranges, angles, MODEL)

    def cost(parameters):
        return squared_errors(line, ranges, angles, MODEL, *parameters)[2]

    found = minimize(
        cost, [line.slope + 0.3, line.intercept - 0.2], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}
    )
    np.testing.assert_allclose(found.x, [line.slope, line.intercept], atol=1e-6)
    assert cost([line.slope, line.intercept]) <= found.fun * (1.0 + 1e-12)


@law
@given(st.floats(-math.pi, math.pi), st.floats(0.3, 8.0))
def test_points_without_noise_give_their_line(normal_angle, distance):
    points = wall(normal_angle, distance, -1.5, 4.0, 50)
    line = fit_cwlf(*polar(points), MODEL)
    u, v = (points[:, 1], points[:, 0]) if line.vertical else (points[:, 0], points[:, 1])
    np.testing.assert_allclose(line.slope * (u - line.center) + line.intercept, v, atol=1e-12)
    np.testing.assert_allclose([line.start, line.end], points[[0, -1]], atol=1e-12)
    # The regressed axis is the flatter one.
    assert abs(line.slope) <= 1.0 + 1e-9


@pytest.mark.parametrize("normal_angle", [0.1, 0.7, 0.9, 1.4, 2.6, -1.2])
@pytest.mark.parametrize("start", [-2.0, 0.5])
def test_propagated_covariance_is_the_first_order_one_of_the_estimator_with_fixed_weights(normal_angle, start):
    """Derivatives of slope and of height at the centre by every range and bearing, finite differences (eq. M4-M6)."""
    ranges, angles = polar(wall(normal_angle, 1.5, start, 2.5, 40))
    line = fit_cwlf(ranges, angles, MODEL)
    w, _, _ = squared_errors(line, ranges, angles, MODEL, line.slope, line.intercept)

    def estimate(measured):
        x, y = measured[:40] * np.cos(measured[40:]), measured[:40] * np.sin(measured[40:])
        u, v = (y, x) if line.vertical else (x, y)
        mean_u, mean_v = w @ u / w.sum(), w @ v / w.sum()
        slope = w @ ((u - mean_u) * (v - mean_v)) / (w @ (u - mean_u) ** 2)
        return np.array([slope, mean_v + slope * (line.center - mean_u)])

    jacobian = finite_difference(estimate, np.concatenate([ranges, angles]))
    variances = np.repeat([MODEL.sigma_range**2, MODEL.sigma_bearing**2], 40)
    np.testing.assert_allclose(
        line.cov, jacobian * variances @ jacobian.T, rtol=1e-8, atol=1e-8 * np.diag(line.cov).min()
    )


@pytest.mark.parametrize(("normal_angle", "start"), [(0.2, -1.5), (1.3, 0.5), (2.4, -3.0)])
def test_propagated_covariance_is_that_of_many_noisy_fits(normal_angle, start):
    """4000 fits, noise as in section III: bearing first, then the range to the wall.

    A sample variance has a standard error of 2.2 %, the propagation is of first order in 10 mm against metres: 12 % are
    five standard errors and 1 % for the rest. The correlation's standard error is 1.6 %.
    """
    model = SensorModel(0.01, 0.002, 0.1, 40.0)
    rng = np.random.default_rng(11)
    points = wall(normal_angle, 2.0, start, 3.0, 80)
    true_ranges, angles = polar(points)
    exact = fit_cwlf(true_ranges, angles, model)
    estimates = np.empty((4000, 2))
    for k in range(len(estimates)):
        struck = angles + model.sigma_bearing * rng.standard_normal(80)
        ranges = 2.0 / np.cos(struck - normal_angle) + model.sigma_range * rng.standard_normal(80)
        line = fit_cwlf(ranges, angles, model)
        assert line.vertical == exact.vertical
        estimates[k] = line.slope, line.intercept + line.slope * (exact.center - line.center)
    sampled = np.cov(estimates.T)
    np.testing.assert_allclose(np.diag(sampled) / np.diag(exact.cov), 1.0, atol=0.12)
    sigmas, sampled_sigmas = np.sqrt(np.diag(exact.cov)), np.sqrt(np.diag(sampled))
    assert sampled[0, 1] / sampled_sigmas.prod() == pytest.approx(exact.cov[0, 1] / sigmas.prod(), abs=0.08)


def test_paper_form_promises_too_little_on_a_wall_across_the_axes():
    """Why it is not the default: a residual's variance is up to (sigma_range / rho sigma_bearing)^2 = 26 times it."""
    ranges, angles = polar(wall(0.7, 2.0, -1.0, 2.0, 80))
    promised, propagated = (np.diag(fit_cwlf(ranges, angles, MODEL, form).cov) for form in ("paper", "propagated"))
    assert (propagated > 4.0 * promised).all()


@law
@given(st.integers(1, 2000))
def test_misfit_that_chance_explains_leaves_the_covariance_as_it_is(freedom):
    assert misfit_scale(float(freedom), freedom) == 1.0
    assert misfit_scale(freedom + 3.0 * math.sqrt(2.0 * freedom) - 1e-9, freedom) == 1.0


@law
@given(st.integers(1, 2000), st.floats(1.0, 1e6))
def test_misfit_beyond_chance_scales_in_proportion_and_without_a_step(freedom, excess):
    limit = freedom + 3.0 * math.sqrt(2.0 * freedom)
    assert misfit_scale(excess * limit, freedom) == pytest.approx(excess)


@pytest.mark.parametrize("freedom", [0, -1])
def test_a_line_without_redundancy_has_no_misfit(freedom):
    assert misfit_scale(123.0, freedom) == 1.0


def test_noise_as_promised_does_not_scale_the_covariance():
    """Chi-square with 78 degrees exceeds its mean by three deviations in 0.4 % of walls: 2 of 500, never 11."""
    rng = np.random.default_rng(5)
    normal_angle, scaled = 1.1, 0
    angles = polar(wall(normal_angle, 2.0, -1.5, 3.0, 80))[1]
    for _ in range(500):
        struck = angles + MODEL.sigma_bearing * rng.standard_normal(80)
        ranges = 2.0 / np.cos(struck - normal_angle) + MODEL.sigma_range * rng.standard_normal(80)
        line = fit_cwlf(ranges, angles, MODEL)
        scaled += _scale(line, ranges, angles) > 1.0 + 1e-9
    assert scaled <= 10


def test_a_rough_wall_is_as_uncertain_as_its_points_show():
    """A wave of 60 mm under 20 mm of noise: M7 scales the propagated covariance and leaves the estimate alone."""
    normal_angle = 1.1
    ranges, angles = polar(wall(normal_angle, 2.0, -1.5, 3.0, 80))
    rough = ranges + 0.06 * np.sin(np.arange(80.0))
    line = fit_cwlf(rough, angles, MODEL)
    assert _scale(line, rough, angles) == pytest.approx(_expected_scale(line, rough, angles), rel=1e-9)
    assert _scale(line, rough, angles) > 2.0
    paper = fit_cwlf(rough, angles, MODEL, "paper")
    assert (paper.slope, paper.intercept) == (line.slope, line.intercept)
    w, u, _ = squared_errors(paper, rough, angles, MODEL, paper.slope, paper.intercept)
    np.testing.assert_allclose(np.diag(paper.cov), [1.0 / (w @ (u - paper.center) ** 2), 1.0 / w.sum()], rtol=1e-9)


def _effective_variances(line, ranges, angles):
    normal = np.array([1.0, -line.slope]) if line.vertical else np.array([-line.slope, 1.0])
    covs = [cartesian_cov(r, a, MODEL.sigma_range, MODEL.sigma_bearing) for r, a in zip(ranges, angles, strict=True)]
    return np.array([normal @ cov @ normal for cov in covs])


def _scale(line, ranges, angles):
    """Factor by which the variance of the intercept exceeds eq. M5."""
    w, _, _ = squared_errors(line, ranges, angles, MODEL, line.slope, line.intercept)
    return line.cov[1, 1] / ((w**2 @ _effective_variances(line, ranges, angles)) / w.sum() ** 2)


def _expected_scale(line, ranges, angles):
    x, y = ranges * np.cos(angles), ranges * np.sin(angles)
    u, v = (y, x) if line.vertical else (x, y)
    residuals = v - line.intercept - line.slope * (u - line.center)
    freedom = len(ranges) - 2
    return (residuals**2 / _effective_variances(line, ranges, angles)).sum() / (
        freedom + 3.0 * math.sqrt(2.0 * freedom)
    )


@pytest.mark.parametrize(
    ("ranges", "angles", "message"),
    [
        ([], [], "0 points do not define a line: expected two or more"),
        ([1.0], [0.3], "1 points do not define a line"),
        ([2.0] * 7, [0.4] * 7, "all 7 points coincide"),
        ([1.0, np.inf, 2.0], [0.0, 0.1, 0.2], "positive, finite ranges"),
        ([1.0, np.nan, 2.0], [0.0, 0.1, 0.2], "positive, finite ranges"),
        ([1.0, 0.0, 2.0], [0.0, 0.1, 0.2], "positive, finite ranges"),
        ([1.0, -1.0, 2.0], [0.0, 0.1, 0.2], "positive, finite ranges"),
        ([1.0, 1.0, 2.0], [0.0, np.nan, 0.2], "finite angles"),
    ],
)
@pytest.mark.parametrize("form", FORMS)
def test_a_segment_that_defines_no_line_is_refused(ranges, angles, message, form):
    with pytest.raises(DegenerateSegmentError, match=message):
        fit_cwlf(np.array(ranges), np.array(angles), MODEL, form)


@pytest.mark.parametrize("angle", [0.3, 2.9, -1.2])
def test_a_wall_seen_edge_on_is_a_line_through_the_sensor(angle):
    """All points on one beam: the slope is the beam's, the bearing noise alone decides about it."""
    line = fit_cwlf(np.linspace(1.0, 3.0, 20), np.full(20, angle), MODEL)
    slope = 1.0 / math.tan(angle) if line.vertical else math.tan(angle)
    assert line.slope == pytest.approx(slope)
    assert line.intercept == pytest.approx(line.slope * line.center)
    assert (np.linalg.eigvalsh(line.cov) > 0.0).all()
