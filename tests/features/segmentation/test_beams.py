"""Beams to points: order, gaps, sine and cosine; and that calls do not disturb each other's work arrays."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import law
from scenes import FULL_TURN, free_pose, noisy_scan

from features import LaserScan, extract, sensor_preset
from features.segmentation.beams import gather_returns, to_cartesian, turn_of
from sim import room

MODEL = sensor_preset("rplidar-s1")


def gathered(ranges, angles, range_min=0.1, range_max=40.0):
    kept = np.empty((2, len(ranges) + 1))
    beams = np.empty(len(ranges) + 1, np.int64)
    n, spacing = gather_returns(ranges, angles, range_min, range_max, *kept, beams)
    return kept[0, :n], kept[1, :n], beams[:n], spacing


@pytest.mark.slow
@law
@given(st.lists(st.floats(-4.0 * math.pi, 4.0 * math.pi), min_size=1, max_size=50))
def test_points_are_those_of_numpy_to_two_units_in_the_last_place_of_the_range(angles):
    angles = np.array(angles)
    ranges = np.linspace(0.1, 30.0, angles.size)
    xs, ys = np.empty(angles.size), np.empty(angles.size)
    to_cartesian(ranges, angles, angles.size, xs, ys)
    assert (np.abs(xs - ranges * np.cos(angles)) <= 2.0 * np.spacing(ranges)).all()
    assert (np.abs(ys - ranges * np.sin(angles)) <= 2.0 * np.spacing(ranges)).all()


def test_points_on_the_axes_and_the_diagonals():
    """Where the quadrant changes; on an axis the rounding of the angle itself, some 1e-16, is left."""
    angles = np.arange(-16, 17) * math.pi / 4.0
    xs, ys = np.empty(angles.size), np.empty(angles.size)
    to_cartesian(np.ones(angles.size), angles, angles.size, xs, ys)
    np.testing.assert_allclose(xs, np.cos(angles), rtol=0.0, atol=3e-16)
    np.testing.assert_allclose(ys, np.sin(angles), rtol=0.0, atol=3e-16)


def test_the_turn_of_angles():
    assert turn_of(np.array([0.0, 0.1, 0.1, 0.5])) == 1
    assert turn_of(np.array([0.5, 0.1, 0.1, 0.0])) == -1
    assert turn_of(np.array([0.0, 0.2, 0.1])) == 0
    assert turn_of(np.array([0.0, 3.0, 2.0 * math.pi])) == 0, "a beam of the next turn is among those of the first"
    assert turn_of(np.array([1.0])) == 1


@pytest.mark.slow
@law
@given(st.integers(0, 2**32 - 1), st.floats(-100.0, 100.0))
def test_beams_with_a_return_come_counter_clockwise_whatever_their_order(seed, shift):
    rng = np.random.default_rng(seed)
    angles = np.linspace(0.3, 5.0, 40)
    ranges = rng.uniform(0.05, 45.0, angles.size)
    expected = np.flatnonzero((ranges >= 0.1) & (ranges <= 40.0))
    for order in (np.arange(40), np.arange(40)[::-1], rng.permutation(40)):
        got_ranges, got_angles, beams, spacing = gathered(ranges[order], angles[order] + shift)
        assert (np.diff(got_angles) > 0.0).all()
        first = int(np.flatnonzero(expected == order[beams[0]])[0]) if expected.size else 0
        np.testing.assert_array_equal(order[beams], np.roll(expected, -first))
        np.testing.assert_array_equal(got_ranges, ranges[order][beams])
        np.testing.assert_allclose(np.cos(got_angles - angles[order][beams] - shift), 1.0, atol=1e-12)
        np.testing.assert_allclose(spacing, 4.7 / 39, rtol=1e-9)


def test_the_spacing_leaves_out_the_largest_gap_wherever_the_scan_begins():
    """A quarter turn that the scanner's zero divides: its beams are as close as those of one that it does not."""
    quarter = np.linspace(-math.pi / 4.0, math.pi / 4.0, 91)
    wrapped = np.sort(quarter % (2.0 * math.pi))
    for angles in (quarter, wrapped, wrapped[::-1].copy()):
        np.testing.assert_allclose(gathered(np.ones(91), angles)[3], math.radians(1.0), rtol=1e-9)


def test_threads_extract_side_by_side():
    """The kernel runs without the interpreter's lock, in work arrays of its thread."""
    rng = np.random.default_rng(0)
    scans = [
        noisy_scan(room(), free_pose(room(), rng), rng, 0.02, 0.002, FULL_TURN[:: 1 + k % 3].copy()) for k in range(60)
    ]
    alone = [extract(scan, MODEL) for scan in scans]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda scan: extract(scan, MODEL), scans * 5))
    for k, features in enumerate(together):
        np.testing.assert_array_equal(features.lines.records, alone[k % 60].lines.records)
        np.testing.assert_array_equal(features.corners.records, alone[k % 60].corners.records)


def test_results_are_not_overwritten_by_the_next_scan():
    rng = np.random.default_rng(1)
    scans = [noisy_scan(room(), free_pose(room(), rng), rng, 0.02, 0.002) for _ in range(2)]
    first = extract(scans[0], MODEL)
    kept = first.lines.records.copy(), first.corners.records.copy()
    extract(LaserScan(scans[1].ranges, scans[1].angles), MODEL)
    np.testing.assert_array_equal(first.lines.records, kept[0])
    np.testing.assert_array_equal(first.corners.records, kept[1])
