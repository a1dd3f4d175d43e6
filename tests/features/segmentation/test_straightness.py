"""Straightness (eq. M101, M102): straight walls stay whole, two surfaces are not one line, bends are told."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
from scenes import square

from features import ExtractionConfig, LaserScan, extract, sensor_preset
from features.feature import LineForm
from features.se2 import Array

MODEL = sensor_preset("rplidar-s1")
Surface = Callable[[Array], Array]

NEVER = 1e-300
"""A level at which no wall is split."""


def scan_of(surface: Surface, angles: Array, rng: np.random.Generator) -> LaserScan:
    """Scan of a surface, given as range at a bearing, with the noise of the sensor: a beam in error hits elsewhere."""
    ranges = surface(angles + MODEL.sigma_bearing * rng.standard_normal(len(angles)))
    return LaserScan(ranges + MODEL.sigma_range * rng.standard_normal(len(angles)), angles)


def straight_walls(rng: np.random.Generator, number: int):
    """Scans of walls at any range and incidence, of 10 to 400 points."""
    for _ in range(number):
        distance, first, width = rng.uniform(0.5, 8.0), rng.uniform(-1.2, 1.0), rng.uniform(0.1, 1.2)
        angles = np.linspace(first, min(first + width, 1.2), int(rng.integers(10, 400)))
        yield scan_of(lambda bearings, distance=distance: distance / np.cos(bearings), angles, rng)


def most(share: float, count: int) -> float:
    """A share and three standard deviations of its estimate from ``count`` draws."""
    return share + 3.0 * math.sqrt(share * (1.0 - share) / count)


def bends(scan: LaserScan, config: ExtractionConfig) -> Array:
    """What the bend of each line adds to its standard deviation across [m]: the covariance with it and without."""
    lines = extract(scan, MODEL, config).lines
    plain = extract(scan, MODEL, ExtractionConfig(**{**config.model_dump(), "bend_sigmas": 1e9})).lines
    assert (lines.forms != LineForm.POLAR).all()
    return np.sqrt((lines.covs - plain.covs)[:, 1, 1] / (1.0 + lines.params[:, 0] ** 2))


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.01, 0.2])
def test_chance_splits_a_straight_wall_less_often_than_its_level_says(level):
    rng, number = np.random.default_rng(1), 3000
    split = 0
    for scan in straight_walls(rng, number):
        found, whole = (extract(scan, MODEL, ExtractionConfig(straight_level=each)).lines for each in (level, NEVER))
        split += not np.array_equal(found.beams, whole.beams)
    assert split / number <= most(level, number)


def test_a_dense_oblique_wall_stays_one_line():
    """Beams a millimetre apart on it, noise of two centimetres along it."""
    rng, angles = np.random.default_rng(6), np.linspace(1.1, 1.2, 300)
    for _ in range(30):
        scan = scan_of(lambda bearings: 1.0 / np.cos(bearings), angles, rng)
        found, whole = (extract(scan, MODEL, ExtractionConfig(straight_level=each)).lines for each in (1e-4, NEVER))
        np.testing.assert_array_equal(found.beams, whole.beams)


def stepped(rng: np.random.Generator) -> tuple[LaserScan, float, float]:
    """Two parallel walls, 8 to 20 cm apart, of 40 to 200 points together; the distances of both [m]."""
    near = rng.uniform(1.5, 4.0)
    far = near + rng.choice([-1.0, 1.0]) * rng.uniform(0.08, 0.2)
    half, count = rng.uniform(0.3, 0.6), int(rng.integers(20, 100))
    angles = np.linspace(-half, half, 2 * count)
    return scan_of(lambda bearings: np.where(bearings < 0.0, near, far) / np.cos(bearings), angles, rng), near, far


@pytest.mark.slow
def test_two_parallel_walls_are_two_lines_that_err_as_they_say():
    """Squared, normalised error of each line against the wall that most of its points are on."""
    rng = np.random.default_rng(2)
    nees = {0.01: [], NEVER: []}
    for _ in range(400):
        scan, near, far = stepped(rng)
        middle = int(np.searchsorted(scan.angles, 0.0))
        for level, errors in nees.items():
            lines = extract(scan, MODEL, ExtractionConfig(straight_level=level)).lines
            for line, beams in zip(lines, lines.beams, strict=True):
                assert line.form == LineForm.X_ON_Y
                error = line.params - [0.0, near if beams.mean() < middle else far]
                errors.append(error @ np.linalg.solve(line.cov, error))
    assert np.mean(nees[0.01]) / 2.0 < 1.3
    assert np.mean(np.array(nees[0.01]) > 13.8) < 0.01
    assert np.mean(nees[NEVER]) / 2.0 > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("inside", [False, True], ids=["column", "bay"])
def test_a_line_along_an_arc_claims_no_more_than_it_keeps(inside):
    """Distance of its middle and its ends from the arc, over what the line claims there."""
    rng = np.random.default_rng(3)
    beyond = []
    for _ in range(300):
        radius = rng.uniform(1.0, 3.0)
        distance = rng.uniform(0.0, 0.5) * radius if inside else radius + rng.uniform(0.5, 3.0)
        bearings = np.linspace(-0.7, 0.7, 200) if inside else np.linspace(-0.9, 0.9, 400) * math.asin(radius / distance)
        side = 1.0 if inside else -1.0

        def surface(bearings, radius=radius, distance=distance, side=side):
            away = np.sqrt(np.maximum(radius**2 - (distance * np.sin(bearings)) ** 2, 0.0))
            return distance * np.cos(bearings) + side * away

        for line in extract(scan_of(surface, bearings, rng), MODEL).lines:
            u = 1 if line.form == LineForm.X_ON_Y else 0
            for place in (line.start, line.end, (line.start + line.end) / 2.0):
                arm = np.array([place[u] - line.center, 1.0])
                sigma = math.sqrt(arm @ line.cov @ arm / (1.0 + line.params[0] ** 2))
                beyond.append(abs(np.hypot(place[0] - distance, place[1]) - radius) / sigma)
    assert np.mean(np.array(beyond) > 3.0) < 0.03


@pytest.mark.slow
def test_the_bend_of_a_parabola_is_unbiased():
    """Against the parabola less its regression line, at the ends of what is fitted."""
    rng = np.random.default_rng(4)
    config = ExtractionConfig(straight_level=NEVER)
    angles = np.linspace(-0.32, 0.32, 200)

    def surface(bearings):
        """x = 3 + 0.04 y^2."""
        return 6.0 / (np.cos(bearings) + np.sqrt(np.cos(bearings) ** 2 - 0.48 * np.sin(bearings) ** 2))

    ratios = []
    for _ in range(500):
        scan = scan_of(surface, angles, rng)
        lines = extract(scan, MODEL, config).lines
        if len(lines) > 1:  # IEPF splits one of a hundred
            continue
        first, last = lines.beams[0]
        kept = (surface(angles) * np.sin(angles))[first : last + 1]
        # The noise across a wall falls with the cosine of the incidence.
        weights = 1.0 / np.cos(angles[first : last + 1])
        left = 0.04 * kept**2 - np.polynomial.Polynomial.fit(kept, 0.04 * kept**2, 1, w=weights)(kept)
        ratios.append(bends(scan, config)[0] / np.abs(left[[0, -1]]).max())
    assert np.mean(ratios) == pytest.approx(1.0, abs=3.0 * np.std(ratios) / math.sqrt(len(ratios)) + 0.01)


@pytest.mark.slow
def test_chance_bends_one_straight_wall_of_twenty():
    """Two standard deviations: 4.6 %."""
    rng, number = np.random.default_rng(5), 3000
    config = ExtractionConfig(straight_level=NEVER)
    found = np.concatenate([bends(scan, config) for scan in straight_walls(rng, number)])
    assert len(found) > 0.9 * number
    assert (found > 0.0).mean() == pytest.approx(0.0455, abs=3.0 * math.sqrt(0.0455 * 0.9545 / len(found)))


def test_a_corner_of_exact_walls_is_neither_split_nor_bent():
    """Residuals of zero, or of rounding."""
    angles = np.linspace(-math.pi, math.pi, 400, endpoint=False)
    ranges, _ = square().cast(np.zeros(3), angles)
    scan = LaserScan(ranges, angles)
    assert len(extract(scan, MODEL).lines) == 4
    np.testing.assert_array_equal(bends(scan, ExtractionConfig()), 0.0)


@pytest.mark.parametrize("sigma_range", [1e-9, 1e-3, 1e3])
@pytest.mark.parametrize("sigma_bearing", [1e-9, 1e-3, 1.0])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9], ids=["at the sensor", "near", "far"])
@pytest.mark.parametrize("shape", ["wall", "one point", "square", "line of sight"])
def test_what_determines_nothing_is_finite(shape, scale, sigma_range, sigma_bearing):
    angles = np.linspace(-math.pi, math.pi, 60, endpoint=False)
    ranges, angles = {
        "wall": lambda: (1.0 / np.cos(angles / 4.0), angles / 4.0),
        "one point": lambda: (np.ones(60), np.zeros(60)),
        "square": lambda: (square().cast(np.zeros(3), angles)[0], angles),
        "line of sight": lambda: (np.linspace(1.0, 2.0, 60), np.zeros(60)),
    }[shape]()
    model = dataclasses.replace(
        MODEL, sigma_range=sigma_range, sigma_bearing=sigma_bearing, range_min=0.0, range_max=1e12
    )
    for count in (0, 1, 2, 4, 5, 6, 60):
        found = extract(LaserScan(scale * ranges[:count], angles[:count]), model)
        assert np.isfinite(found.lines.covs).all()
        assert np.isfinite(found.corners.positions).all()
        assert np.isfinite(found.corners.covs).all()
