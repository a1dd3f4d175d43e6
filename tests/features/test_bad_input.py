"""What is no measurement is refused by name or shows nothing; never a covariance that is not a number."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from laws import law
from scenes import FULL_TURN

from features import (
    CwlfError,
    DegenerateSegmentError,
    ExtractionConfig,
    LaserScan,
    ScanFormatError,
    extract,
    fit_line,
    sensor_preset,
)

MODEL = sensor_preset("rplidar-s1")
FITS = ["effective-variance", "cwlf", "arras-siegwart", "total-least-squares"]
with_each_fit = pytest.mark.parametrize("fit", FITS)
ANYTHING = st.one_of(st.floats(0.1, 10.0), st.floats(), st.sampled_from([math.nan, math.inf, -math.inf, -1.0, 0.0]))


def assert_numbers(lines, corners):
    """Finite, symmetric and without a negative variance beyond rounding."""
    for values in (lines.params, lines.centers, lines.covs, lines.ends, corners.positions, corners.covs):
        assert np.isfinite(values).all()
    for covs in (lines.covs, corners.covs):
        scaled = covs / np.maximum(np.trace(covs, axis1=1, axis2=2), 1e-300)[:, None, None]
        assert np.linalg.eigvalsh(scaled).min(initial=0.0) > -1e-12


@with_each_fit
@law
@given(data=st.data(), n=st.integers(0, 40))
def test_any_numbers_are_refused_or_extracted(fit, data, n):
    ranges, angles = (data.draw(arrays(np.float64, n, elements=ANYTHING)) for _ in range(2))
    usable = (ranges >= 0.0).all() and np.isfinite(angles).all()
    try:
        scan = LaserScan(ranges, angles)
    except ScanFormatError:
        assert not usable
        return
    assert usable
    features = extract(scan, MODEL, ExtractionConfig(fit=fit, min_points=2, trim_points=0, trim_sigmas=0.0))
    assert_numbers(features.lines, features.corners)


@pytest.mark.slow
@with_each_fit
@law
@given(data=st.data(), n=st.integers(0, 12))
def test_a_segment_of_any_numbers_is_refused_or_fitted(fit, data, n):
    ranges, angles = (data.draw(arrays(np.float64, n, elements=ANYTHING)) for _ in range(2))
    # Squares of longer ranges leave the numbers that a float holds; no sensor measures a light second.
    ranges = np.where(np.isfinite(ranges), np.clip(ranges, -1e8, 1e8), ranges)
    ranges = np.where((ranges > 0.0) & (ranges < 1e-6), 1e-6, ranges)
    angles = np.where(np.isfinite(angles), np.clip(angles, -1e6, 1e6), angles)
    try:
        line = fit_line(ranges, angles, MODEL, fit)
    except CwlfError:
        return
    assert (np.isfinite(ranges) & (ranges > 0.0) & np.isfinite(angles)).all()
    assert np.isfinite(line.params).all()
    assert np.isfinite(line.cov).all()
    assert (np.diag(line.cov) >= 0.0).all()


@pytest.mark.parametrize("bad", [math.nan, -1.0, -math.inf])
def test_a_scan_with_one_bad_range_is_refused(bad):
    ranges = np.full(920, 2.0)
    ranges[17] = bad
    with pytest.raises(ScanFormatError, match="range of beam 17"):
        LaserScan(ranges, FULL_TURN)


@with_each_fit
@pytest.mark.parametrize("no_return", [np.inf, 0.0])
def test_no_return_at_all_shows_nothing(fit, no_return):
    features = extract(LaserScan(np.full(920, no_return), FULL_TURN), MODEL, ExtractionConfig(fit=fit))
    assert (len(features.lines), len(features.corners)) == (0, 0)


@with_each_fit
@law
@given(st.floats(0.2, 30.0), st.floats(0.2, 30.0), st.floats(-3.0, 3.0), st.floats(1e-3, 3.0))
def test_two_points_are_a_line_through_both(fit, first, second, angle, apart):
    """Without redundancy the fit is the two points, its covariance theirs; extraction wants min_points."""
    ranges, angles = np.array([first, second]), np.array([angle, angle + apart])
    line = fit_line(ranges, angles, MODEL, fit)
    points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
    np.testing.assert_allclose([line.start, line.end], points, atol=1e-6)
    assert np.isfinite(line.cov).all()
    assert np.linalg.det(line.cov / np.sqrt(np.outer(np.diag(line.cov), np.diag(line.cov)))) > -1e-9
    features = extract(LaserScan(ranges, angles), MODEL, ExtractionConfig(fit=fit))
    assert len(features.lines) == 0


@with_each_fit
@law
@given(n=st.integers(1, 50), range_=st.floats(0.2, 30.0), angle=st.floats(-3.0, 3.0))
def test_points_that_all_coincide_are_refused_or_show_nothing(fit, n, range_, angle):
    ranges, angles = np.full(n, range_), np.full(n, angle)
    with pytest.raises(DegenerateSegmentError):
        fit_line(ranges, angles, MODEL, fit)
    features = extract(LaserScan(ranges, angles), MODEL, ExtractionConfig(fit=fit))
    assert (len(features.lines), len(features.corners)) == (0, 0)


@with_each_fit
def test_equal_ranges_all_around_are_no_corner(fit):
    """A circle: the sensor sees chords, no two of which meet at more than a few degrees."""
    features = extract(LaserScan(np.full(920, 2.0), FULL_TURN), MODEL, ExtractionConfig(fit=fit))
    assert_numbers(features.lines, features.corners)
    assert len(features.corners) == 0


@with_each_fit
@law
@given(seed=st.integers(0, 2**32 - 1))
def test_unsorted_angles_are_sorted(fit, seed):
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-math.pi, math.pi, 300)
    ranges = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    config = ExtractionConfig(fit=fit, gap_beams=20.0)
    order = np.argsort(angles)
    shuffled = extract(LaserScan(ranges, angles), MODEL, config)
    ordered = extract(LaserScan(ranges[order], angles[order]), MODEL, config)
    assert_numbers(shuffled.lines, shuffled.corners)
    assert len(shuffled.lines) == len(ordered.lines)
    assert len(shuffled.corners) == len(ordered.corners)


@pytest.mark.parametrize("name", ["sigma_range", "sigma_bearing"])
@pytest.mark.parametrize("value", [0.0, -1e-3, math.nan, math.inf])
def test_a_sensor_without_noise_is_refused(name, value):
    with pytest.raises(ValueError, match=name):
        dataclasses.replace(MODEL, **{name: value})
