"""The compiled extraction finds what its plain twin finds, beam by beam and digit by digit."""

import dataclasses

import numpy as np
import pytest

from features import ExtractionConfig, LaserScan, SensorModel, extract, sensor_preset
from sim import room

from . import extraction_twin
from .scenes import FULL_TURN, HALF_TURN, exact_scan, free_pose, noisy_scan, square

MODEL = sensor_preset("rplidar-s1")
ROUGH = dataclasses.replace(MODEL, sigma_range=0.04)
LOOSE = ExtractionConfig(
    jump_angle_deg=4.0,
    gap_beams=1.5,
    split_distance_mm=20.0,
    split_sigmas=3.0,
    trim_points=0,
    trim_sigmas=0.0,
    min_points=2,
    min_length_m=0.05,
    corner_angle_min_deg=10.0,
    corner_angle_max_deg=170.0,
    corner_gap_mm=300.0,
)
"""Splits at noise, keeps the smallest lines and takes blunt corners: every rule decides often."""


def assert_same(scan: LaserScan, model: SensorModel, config: ExtractionConfig) -> tuple[int, int]:
    """Lines and corners in the same order; 1e-9 of a metre, a radian or of the largest entry of a covariance."""
    lines, corners = extraction_twin.extract(scan.ranges, scan.angles, model, config)
    found = extract(scan, model, config)
    assert [line.beams for line in lines] == [tuple(pair) for pair in found.lines.beams.tolist()]
    assert len(corners) == len(found.corners)
    for twin, line in zip(lines, found.lines, strict=True):
        assert (line.vertical, line.count) == (twin.vertical, twin.count)
        expected = [twin.slope, twin.intercept, twin.center]
        np.testing.assert_allclose([line.slope, line.intercept, line.center], expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose([line.start, line.end], twin.ends, atol=1e-9)
        np.testing.assert_allclose(line.cov, twin.cov, rtol=1e-9, atol=1e-9 * np.diag(twin.cov).min())
    for twin, corner in zip(corners, found.corners, strict=True):
        np.testing.assert_allclose(corner.position, twin.position, atol=1e-9)
        np.testing.assert_allclose(corner.cov, twin.cov, rtol=0.0, atol=1e-9 * np.abs(twin.cov).max())
        assert corner.opening_angle == pytest.approx(twin.opening_angle, abs=1e-9)
        assert np.cos(corner.orientation - twin.orientation) == pytest.approx(1.0, abs=1e-12)
        assert corner.convex == twin.convex
    return len(lines), len(corners)


@pytest.mark.parametrize("form", ["propagated", "paper"])
@pytest.mark.parametrize("angles", [FULL_TURN, HALF_TURN], ids=["full turn", "half turn"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_simulated_scans(angles, form, seed):
    rng = np.random.default_rng(seed)
    found = [
        assert_same(
            noisy_scan(room(), free_pose(room(), rng), rng, MODEL.sigma_range, MODEL.sigma_bearing, angles),
            MODEL,
            ExtractionConfig(covariance=form),
        )
        for _ in range(6)
    ]
    assert min(lines for lines, _ in found) >= 1
    assert sum(corners for _, corners in found) >= 6


@pytest.mark.parametrize("config", [ExtractionConfig(), LOOSE], ids=["default", "loose"])
@pytest.mark.parametrize("seed", [3, 4])
def test_noise_that_splits_walls(config, seed):
    rng = np.random.default_rng(seed)
    for angles in (FULL_TURN, HALF_TURN):
        scan = noisy_scan(room(), free_pose(room(), rng), rng, ROUGH.sigma_range, ROUGH.sigma_bearing, angles)
        assert_same(scan, ROUGH, config)


@pytest.mark.parametrize("seed", [5, 6])
def test_clockwise_shuffled_and_missing_beams(seed):
    rng = np.random.default_rng(seed)
    scan = noisy_scan(room(), free_pose(room(), rng), rng, MODEL.sigma_range, MODEL.sigma_bearing)
    ranges = np.where(rng.uniform(size=len(scan)) < 0.05, np.inf, scan.ranges)
    for order in (np.arange(len(scan))[::-1], rng.permutation(len(scan))):
        assert_same(LaserScan(ranges[order], scan.angles[order]), MODEL, ExtractionConfig())


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 4.0])
def test_a_closed_contour(turn):
    lines, corners = assert_same(exact_scan(square(turn=turn, shift=(0.3, -0.2))), MODEL, ExtractionConfig())
    assert (lines, corners) == (4, 4)


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_scans_that_show_nothing_in_particular(seed):
    """Ranges without any wall in them, with the loosest rules."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(-np.pi, np.pi, 300))
    assert_same(LaserScan(rng.uniform(0.5, 0.8, 300), angles), MODEL, LOOSE)
    assert_same(LaserScan(rng.uniform(0.0, 45.0, 300), angles), MODEL, LOOSE)
