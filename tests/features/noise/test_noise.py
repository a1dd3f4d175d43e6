"""The noise of a scanner by its own scans: sigma, growth, steps, no return, against a known truth."""

import math
from dataclasses import replace

import numpy as np
import pytest

from features import ExtractionConfig, LaserScan, sensor_preset
from features.noise.gauge import NoiseGauge
from features.noise.measure import line_scatter, measure_sigma, pooled_noise, sigma_of_triples
from features.noise.rules import NoiseRules
from features.noise.steps import no_return_range, range_step
from slam.parts import CwlfExtractor

RULES = NoiseRules()
extract = CwlfExtractor(ExtractionConfig()).of_whole_walls()
MODEL = replace(sensor_preset("rplidar-s1"), sigma_range=0.01, sigma_bearing=math.radians(0.05))
BOX = np.array([[-4.0, -2.5], [3.0, -2.5], [3.0, 2.5], [-4.0, 2.5]])


def cast(corners, angles, position):
    """Ranges from a position to a closed polygon, by brute force."""
    starts, ends = corners - position, np.roll(corners, -1, axis=0) - position
    directions = np.stack([np.cos(angles), np.sin(angles)])
    ways = ends - starts
    determinants = directions[0][:, None] * -ways[:, 1] + directions[1][:, None] * ways[:, 0]
    ranges = (starts[:, 1] * ways[:, 0] - starts[:, 0] * ways[:, 1]) / determinants
    shares = (directions[0][:, None] * starts[:, 1] - directions[1][:, None] * starts[:, 0]) / determinants
    hit = (ranges > 0.0) & (shares >= -1e-9) & (shares <= 1.0 + 1e-9)
    return np.where(hit, ranges, np.inf).min(axis=1)


def scans_of(sigma, seed, count=16, beams=360, corners=BOX, growth=0.0, step=0.0, bearing=MODEL.sigma_bearing):
    """Scans from places of a room, with the noise of the model and a true sigma of its own."""
    rng = np.random.default_rng(seed)
    angles = np.linspace(-math.pi, math.pi, beams, endpoint=False)
    found = []
    for _ in range(count):
        position = rng.uniform([-2.0, -1.0], [1.5, 1.0])
        ranges = cast(corners, angles + rng.uniform(0, 1e-3) + bearing * rng.standard_normal(beams), position)
        ranges = ranges + np.hypot(sigma, growth * ranges) * rng.standard_normal(beams)
        found.append(LaserScan(np.maximum(step * np.round(ranges / step) if step else ranges, 0.0), angles))
    return found


def measured(scans, model=MODEL):
    noise = measure_sigma(scans, model, extract, RULES)
    assert noise is not None
    return noise


@pytest.mark.parametrize("beams", [180, 360, 1440])
@pytest.mark.parametrize("sigma", [0.005, 0.01, 0.02, 0.04])
def test_sigma_is_found_without_bias_from_any_preset_and_within_its_standard_error(sigma, beams):
    noises = [measured(scans_of(sigma, seed, beams=beams)) for seed in range(12)]
    ratios = np.array([noise.sigma for noise in noises]) / sigma
    errors = np.array([noise.error for noise in noises])
    # The bearing part is subtracted, not known; a fiftieth is small against what NEES shows.
    assert ratios.mean() == pytest.approx(1.0, abs=0.02)
    assert (np.abs(ratios - 1.0) < 3.0 * errors + 0.01).all()


def test_the_sigma_of_the_configuration_does_not_enter():
    scans = scans_of(0.02, 3)
    found = [measured(scans, replace(MODEL, sigma_range=sigma)).sigma for sigma in (0.001, 0.02, 0.2)]
    assert found[0] == found[1] == found[2]


def test_triples_tell_sigma_without_lines():
    sigmas = [sigma_of_triples(scan, MODEL) for scan in scans_of(0.02, 5, beams=720)]
    assert np.median([sigma for sigma in sigmas if sigma]) == pytest.approx(0.02, rel=0.1)


def test_points_of_any_line_leave_no_residual_in_a_triple():
    ranges = cast(BOX, np.linspace(0.2, 0.4, 50), np.zeros(2))
    assert sigma_of_triples(LaserScan(ranges, np.linspace(0.2, 0.4, 50)), MODEL) == pytest.approx(0.0, abs=1e-12)


def test_walls_rougher_than_the_scanner_do_not_enter_while_they_are_the_fewer():
    # One of four walls, and none that is long: its variance is nine times that of the others.
    scans = scans_of(0.01, 4, beams=720)
    scatter = np.concatenate([line_scatter(scan, extract(scan, MODEL).lines, MODEL, RULES) for scan in scans])
    rough = scatter.copy()
    rough[::5, 0] *= 9.0
    before, after = pooled_noise(scatter, RULES), pooled_noise(rough, RULES)
    assert before is not None
    assert after is not None
    assert before.sigma <= after.sigma < 1.05 * before.sigma


def test_bends_do_not_inflate_it_where_straight_walls_are_the_most():
    # A bay of half a metre in the wall, as a polygon of short sides.
    turn = np.linspace(math.pi, 0.0, 24)
    bay = np.column_stack([0.5 + 0.7 * np.cos(turn), -2.5 - 0.5 * np.sin(turn)])
    corners = np.concatenate([BOX[:1], bay, BOX[1:]])
    assert measured(scans_of(0.01, 6, beams=720, corners=corners)).sigma == pytest.approx(0.01, rel=0.05)


def rotated(scan):
    return LaserScan(scan.ranges, (scan.angles + 2.0) % (2.0 * math.pi))


def mirrored(scan):
    return LaserScan(scan.ranges, -scan.angles)


def reversed_order(scan):
    return LaserScan(scan.ranges[::-1], scan.angles[::-1])


@pytest.mark.parametrize("change", [rotated, mirrored, reversed_order])
def test_it_does_not_depend_on_axes_or_on_the_sense_of_the_scan(change):
    scans = scans_of(0.02, 7)
    assert measured([change(scan) for scan in scans]).sigma == pytest.approx(measured(scans).sigma, rel=0.02)


@pytest.mark.parametrize("sigma", [0.002, 0.01])
@pytest.mark.parametrize("step", [0.01, 0.05])
def test_steps_are_found_and_add_the_variance_of_rounding(step, sigma):
    scans = scans_of(sigma, 8, step=step, beams=720)
    assert range_step(np.concatenate([scan.ranges for scan in scans]), RULES) == pytest.approx(step)
    assert measured(scans).sigma == pytest.approx(math.hypot(sigma, step / math.sqrt(12.0)), rel=0.15)


def test_ranges_without_steps_have_none():
    assert range_step(np.concatenate([scan.ranges for scan in scans_of(0.01, 9)]), RULES) == 0.0
    # One range over and over again tells no step.
    assert range_step(np.full(1000, 5.0), RULES) == 0.0


def test_growth_with_range_is_found_and_none_where_there_is_none():
    grown = measured(scans_of(0.005, 10, count=40, beams=720, growth=0.01))
    assert grown.growth == pytest.approx(0.01, rel=0.25)
    assert grown.carried_to(2.0 * grown.at).sigma > grown.sigma
    steady = measured(scans_of(0.01, 10, count=40, beams=720))
    assert steady.growth == 0.0
    assert steady.carried_to(2.0 * steady.at) == replace(steady, at=2.0 * steady.at)


def with_no_return(scans, value, share, spread=0.0):
    rng = np.random.default_rng(1)
    changed = []
    for scan in scans:
        ranges = scan.ranges.copy()
        empty = rng.random(ranges.size) < share
        ranges[empty] = value - spread * rng.integers(0, 2, int(empty.sum()))
        changed.append(LaserScan(ranges, scan.angles))
    return changed


@pytest.mark.parametrize("value", [8.19, 51.15, 81.83])
@pytest.mark.parametrize("step", [0.0, 0.01])
def test_a_no_return_value_is_found(value, step):
    found = no_return_range(with_no_return(scans_of(0.01, 11, step=step), value, 0.1, step), step, RULES)
    assert found is not None
    assert found[0] == pytest.approx(value, abs=1.1 * max(step, 1e-4))
    assert 8.0 < found[1] < found[0]


@pytest.mark.parametrize("step", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("sigma", [0.0, 0.005, 0.02])
@pytest.mark.parametrize("moving", [True, False])
def test_walls_are_no_missing_returns(sigma, step, moving):
    scans = scans_of(sigma, 12, step=step)
    assert no_return_range(scans if moving else [scans[0]] * 16, step, RULES) is None


def test_a_scanner_in_the_middle_of_a_square_sees_its_corners():
    square = 3.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    angles = np.linspace(-math.pi, math.pi, 360, endpoint=False) + 1e-6
    scan = LaserScan(np.round(cast(square, angles, np.zeros(2)), 2), angles)
    assert no_return_range([scan] * 16, 0.01, RULES) is None


def gauge(use=True, model=MODEL):
    return NoiseGauge(model, extract, use=use, rules=RULES)


def test_a_gauge_uses_what_it_measures_after_its_start():
    of = gauge()
    changed = [of.see(scan) for scan in with_no_return(scans_of(0.03, 13, beams=720), 40.0, 0.1)]
    assert changed == [False] * 15 + [True]
    assert of.ready
    assert of.sensor.sigma_range == pytest.approx(0.03, rel=0.05)
    assert of.sensor.range_max < 40.0
    summary = of.summary()
    assert summary is not None
    assert summary.scans == 16
    assert summary.no_return_m == pytest.approx(40.0)
    assert "mm measured on 16 scans, 10 mm given" in summary.sentence


def test_a_scanner_better_than_its_preset_is_used_as_such():
    of = gauge()
    for scan in scans_of(0.004, 14, beams=720):
        of.see(scan)
    assert of.sensor.sigma_range == pytest.approx(0.004, rel=0.1)


@pytest.mark.parametrize(("sigma", "contradicts"), [(0.01, False), (0.03, True), (0.003, True)])
def test_a_gauge_that_keeps_what_is_given_says_what_contradicts_it(sigma, contradicts):
    of = gauge(use=False)
    scans = scans_of(sigma, 15, beams=720)
    assert not any(of.see(scan) for scan in scans)
    assert of.sensor == MODEL
    seen = of.watch(scans[0])
    assert (seen is not None) == contradicts
    if seen is not None:
        assert seen == pytest.approx(sigma, rel=0.1)


def test_a_gauge_sees_a_scanner_that_becomes_worse():
    of = gauge()
    for scan in scans_of(0.01, 16, beams=720):
        of.see(scan)
    later = scans_of(0.03, 17, count=RULES.window, beams=720)
    seen = [of.watch(scan) for scan in later]
    assert seen[:-1] == [None] * (RULES.window - 1)
    assert seen[-1] is not None
    assert seen[-1] > 0.02


EMPTY = np.empty(0)
TURN = np.linspace(-math.pi, math.pi, 100, endpoint=False)
DEGENERATE = {
    "empty": LaserScan(EMPTY, EMPTY),
    "one beam": LaserScan(np.ones(1), np.zeros(1)),
    "two beams": LaserScan(np.ones(2), np.array([0.0, 0.1])),
    "no return": LaserScan(np.full(100, np.inf), TURN),
    "zeros": LaserScan(np.zeros(100), TURN),
    "circle": LaserScan(np.full(100, 5.0), TURN),
    "one direction": LaserScan(np.linspace(1.0, 5.0, 100), np.zeros(100)),
    "beyond the limit": LaserScan(np.full(100, 1e6), TURN),
    "huge": LaserScan(np.full(100, 1e300), TURN),
    "tiny": LaserScan(np.full(100, 1e-300), TURN),
}


@pytest.mark.parametrize("name", DEGENERATE)
@pytest.mark.filterwarnings("error")
def test_scans_that_show_nothing_leave_the_noise_as_it_is(name):
    of = gauge()
    for _ in range(RULES.most_scans):
        of.see(DEGENERATE[name])
    assert of.ready
    assert of.sensor.sigma_range == MODEL.sigma_range
    summary = of.summary()
    assert summary is not None
    assert summary.sigma_range_mm is None
    assert "too few walls" in summary.sentence


def test_exact_ranges_leave_a_sigma_that_a_sensor_may_have():
    of = gauge(model=replace(MODEL, sigma_bearing=1e-9))
    for scan in scans_of(0.0, 18, bearing=0.0):
        of.see(scan)
    assert of.sensor.sigma_range == pytest.approx(RULES.least_sigma)
