"""A scan says at once what is wrong with it."""

import numpy as np
import pytest

from features import CwlfError, LaserScan, ScanFormatError

ANGLES = np.array([0.0, 0.1, 0.2])


@pytest.mark.parametrize(
    ("ranges", "angles", "stamp", "message"),
    [
        ([1.0, 2.0], ANGLES, 0.0, r"one angle per range: \(2,\) ranges, \(3,\) angles"),
        ([[1.0, 2.0, 3.0]], [ANGLES], 0.0, r"one angle per range: \(1, 3\) ranges"),
        ([1.0, np.nan, 3.0], ANGLES, 0.0, "range of beam 1 is nan: expected metres, or inf for no return"),
        ([1.0, 2.0, -0.5], ANGLES, 0.0, "range of beam 2 is -0.5"),
        ([-np.inf, 2.0, 1.0], ANGLES, 0.0, "range of beam 0 is -inf"),
        ([1.0, 2.0, 3.0], [0.0, 0.1, np.inf], 0.0, "angle of beam 2 is inf: expected radians"),
        ([1.0, 2.0, 3.0], [np.nan, 0.1, 0.2], 0.0, "angle of beam 0 is nan"),
        ([1.0, 2.0, 3.0], ANGLES, np.nan, "stamp is nan: expected seconds"),
        ([1.0, 2.0, 3.0], ANGLES, np.inf, "stamp is inf"),
    ],
)
def test_a_scan_that_cannot_be_used_is_refused_with_beam_and_value(ranges, angles, stamp, message):
    with pytest.raises(ScanFormatError, match=message) as caught:
        LaserScan(ranges, angles, stamp)
    assert isinstance(caught.value, CwlfError)


@pytest.mark.parametrize(
    ("times", "message"),
    [
        ([0.0, 0.1], r"one time per range: \(3,\) ranges, \(2,\) times"),
        ([0.0, 0.1, np.nan], "time of beam 2 is nan: expected seconds"),
        ([0.0, -np.inf, 0.2], "time of beam 1 is -inf"),
    ],
)
def test_times_that_cannot_be_used_are_refused(times, message):
    with pytest.raises(ScanFormatError, match=message):
        LaserScan([1.0, 2.0, 3.0], ANGLES, 0.0, times)


def test_times_are_kept_and_need_not_be_known():
    scan = LaserScan([1.0, 2.0, 3.0], ANGLES, 5.0, [-2, -1, 0])
    assert scan.times is not None
    assert scan.times.dtype == np.float64
    assert scan.times.tolist() == [-2.0, -1.0, 0.0]
    assert LaserScan([1.0, 2.0, 3.0], ANGLES).times is None


def test_beams_without_return_are_part_of_a_scan():
    scan = LaserScan(np.array([np.inf, 0.0, 3.0]), ANGLES, 1.5)
    assert len(scan) == 3
    assert scan.stamp == 1.5


def test_a_scan_may_be_empty():
    assert len(LaserScan(np.empty(0), np.empty(0))) == 0


def test_ranges_and_angles_become_contiguous_float64():
    scan = LaserScan(np.arange(6, dtype=np.int32)[::2], list(ANGLES))
    for values in (scan.ranges, scan.angles):
        assert values.dtype == np.float64
        assert values.flags.c_contiguous
    np.testing.assert_array_equal(scan.ranges, [0.0, 2.0, 4.0])
