"""The compiled extraction finds what its plain twin finds, beam by beam and digit by digit."""

import dataclasses

import extraction_twin
import numpy as np
import pytest
from scenes import FULL_TURN, HALF_TURN, exact_scan, free_pose, noisy_scan, square

from features import ExtractionConfig, LaserScan, SensorModel, extract, sensor_preset
from features.se2 import wrap_angle
from sim import environment_a, environment_b, random_pose, random_room, room
from sim.worlds.built_in.cluttered_rooms import cluttered_room

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
    straight_level=0.3,
    bend_sigmas=0.5,
    near_sigmas=8.0,
    end_sigmas=6.0,
    corner_level=1e-3,
    unseen_end=0.5,
)
"""Splits at noise, keeps the smallest lines and takes blunt corners: every rule decides often."""


FITS = ["effective-variance", "cwlf", "arras-siegwart", "total-least-squares"]
OTHER_FITS = FITS[1:]


def assert_same(scan: LaserScan, model: SensorModel, config: ExtractionConfig) -> tuple[int, int]:
    """Lines and corners in the same order; 1e-9 of a metre, a radian or of the largest entry of a covariance.

    The effective-variance kernel stops at a step of 1e-4 standard deviations of each parameter and takes its covariance
    from the iterate before: a thousandth of a standard deviation, and of the variance, is what may be left of the
    twin's converged solution on the noisiest walls; of an opening angle, a thousandth of a radian's worth of it.
    """
    lines, corners = extraction_twin.extract(scan.ranges, scan.angles, model, config)
    found = extract(scan, model, config)
    iterated = config.fit == "effective-variance"
    share, exact = (1e-3, 1e-9) if iterated else (0.0, 1e-9)
    # The twin differentiates polar lines by finite differences.
    exact_cov = 1e-6 if config.fit in ("arras-siegwart", "total-least-squares") else exact
    assert [line.beams for line in lines] == [tuple(pair) for pair in found.lines.beams.tolist()]
    assert len(corners) == len(found.corners)
    for twin, line in zip(lines, found.lines, strict=True):
        assert (line.form, line.count) == (twin.form, twin.count)
        sigmas = np.sqrt(np.diag(twin.cov))
        apart = line.params - twin.params
        if twin.form == extraction_twin.POLAR:
            apart[0] = wrap_angle(apart[0])
        assert (np.abs(apart) <= share * sigmas + exact * (1.0 + np.abs(twin.params))).all()
        assert line.center == pytest.approx(twin.center, abs=exact)
        # The ends move with the line: at most as far as the middle and the turn carry them.
        reach = np.hypot(*(twin.ends[1] - twin.ends[0]))
        np.testing.assert_allclose(
            [line.start, line.end], twin.ends, atol=exact + share * (sigmas[1] + reach * sigmas[0])
        )
        scale = np.sqrt(np.outer(np.diag(twin.cov), np.diag(twin.cov)))
        assert (np.abs(line.cov - twin.cov) <= (share + exact_cov) * scale).all()
    for twin, corner in zip(corners, found.corners, strict=True):
        largest = np.abs(twin.cov).max()
        np.testing.assert_allclose(corner.position, twin.position, atol=exact + share * np.sqrt(largest))
        np.testing.assert_allclose(corner.cov, twin.cov, rtol=0.0, atol=(exact_cov + share) * largest)
        assert corner.opening_angle == pytest.approx(twin.opening_angle, abs=exact + share)
        assert wrap_angle(corner.orientation - twin.orientation) == pytest.approx(0.0, abs=exact + share)
        assert corner.convex == twin.convex
    return len(lines), len(corners)


@pytest.mark.parametrize(("fit", "covariance"), [*((fit, "propagated") for fit in FITS), ("cwlf", "paper")])
@pytest.mark.parametrize("angles", [FULL_TURN, HALF_TURN], ids=["full turn", "half turn"])
@pytest.mark.parametrize("seed", [0, 1])
def test_simulated_scans(angles, fit, covariance, seed):
    rng = np.random.default_rng(seed)
    config = ExtractionConfig(fit=fit, covariance=covariance)
    worlds = [room(), environment_a(), environment_b(), random_room(seed)]
    found = [
        assert_same(
            noisy_scan(world, random_pose(world, rng), rng, MODEL.sigma_range, MODEL.sigma_bearing, angles),
            MODEL,
            config,
        )
        for world in worlds
    ]
    assert min(lines for lines, _ in found) >= 1
    assert sum(corners for _, corners in found) >= 6


@pytest.mark.parametrize("fit", FITS)
@pytest.mark.parametrize("config", [ExtractionConfig(), LOOSE], ids=["default", "loose"])
@pytest.mark.parametrize("seed", [3, 4])
def test_noise_that_splits_walls(config, fit, seed):
    """The loosest rules make lines of two points, which iterations do not polish: they are for the closed forms."""
    if fit == "effective-variance":
        config = config.model_copy(update={"min_points": 5, "min_length_m": 0.25})
    rng = np.random.default_rng(seed)
    for angles in (FULL_TURN, HALF_TURN):
        scan = noisy_scan(room(), free_pose(room(), rng), rng, ROUGH.sigma_range, ROUGH.sigma_bearing, angles)
        assert_same(scan, ROUGH, config.model_copy(update={"fit": fit}))


@pytest.mark.parametrize("seed", [5, 6])
def test_clockwise_shuffled_and_missing_beams(seed):
    rng = np.random.default_rng(seed)
    scan = noisy_scan(room(), free_pose(room(), rng), rng, MODEL.sigma_range, MODEL.sigma_bearing)
    ranges = np.where(rng.uniform(size=len(scan)) < 0.05, np.inf, scan.ranges)
    for order in (np.arange(len(scan))[::-1], rng.permutation(len(scan))):
        assert_same(LaserScan(ranges[order], scan.angles[order]), MODEL, ExtractionConfig())


@pytest.mark.parametrize("fit", FITS)
# At exactly 45 degrees rounding alone decides which axis is regressed.
@pytest.mark.parametrize("turn", [0.0, 0.4, 0.785])
def test_a_closed_contour(turn, fit):
    """Its break at the cut moves within the two ends of the contour."""
    world = square(turn=turn, shift=(0.3, -0.2))
    assert assert_same(exact_scan(world), MODEL, ExtractionConfig(fit=fit)) == (4, 4)
    noisy = noisy_scan(world, np.zeros(3), np.random.default_rng(1), ROUGH.sigma_range, ROUGH.sigma_bearing)
    lines, corners = assert_same(noisy, ROUGH, ExtractionConfig(fit=fit))
    # Noise of 4 cm moves the last point of one wall in twenty beyond its reach.
    assert lines == 4
    assert corners >= 3


@pytest.mark.parametrize("fit", OTHER_FITS)
@pytest.mark.parametrize("seed", [7, 8, 9])
def test_scans_that_show_nothing_in_particular(seed, fit):
    """Ranges without any wall in them, with the loosest rules; the iterated fit has no unique solution there.

    One point is trimmed: lines through two points that share the break meet on its beam; rounding says on which side.
    """
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(-np.pi, np.pi, 300))
    config = LOOSE.model_copy(update={"fit": fit, "trim_points": 1})
    assert_same(LaserScan(rng.uniform(0.5, 0.8, 300), angles), MODEL, config)
    assert_same(LaserScan(rng.uniform(0.0, 45.0, 300), angles), MODEL, config)


@pytest.mark.parametrize(
    "config", [ExtractionConfig(), ExtractionConfig(fit="cwlf"), LOOSE], ids=["default", "cwlf", "loose"]
)
@pytest.mark.parametrize("seed", range(4))
def test_cluttered_rooms(seed, config):
    """Columns, bays, niches, cupboards off the wall and slender pillars; the loosest rules with a closed form."""
    if config is LOOSE:
        config = config.model_copy(update={"fit": "total-least-squares", "trim_points": 1})
    world, rng = cluttered_room(seed), np.random.default_rng(seed)
    for _ in range(3):
        pose = random_pose(world, rng)
        assert_same(noisy_scan(world, pose, rng, MODEL.sigma_range, MODEL.sigma_bearing), MODEL, config)


@pytest.mark.slow
def test_the_best_arc_decides_as_the_iterated_one_does():
    """What two iterations leave of an arc's misfit decides about one pair of walls in twenty at most."""
    arcs = []
    for seed in range(18):
        world, rng = cluttered_room(seed), np.random.default_rng(seed)
        scan = noisy_scan(world, random_pose(world, rng), rng, MODEL.sigma_range, MODEL.sigma_bearing)
        extraction_twin.extract(scan.ranges, scan.angles, MODEL, ExtractionConfig(), arcs)
    iterated, best, limit = np.array(arcs).T
    assert len(arcs) > 40
    assert (best <= iterated * (1.0 + 1e-9)).all()
    assert ((best <= limit) != (iterated <= limit)).mean() <= 0.05
    assert 0.05 < (iterated <= limit).mean() < 0.95
