"""The step of ranges, and the range that stands for no return."""

import math
from collections.abc import Sequence

import numpy as np

from features.noise.rules import NoiseRules
from features.scan import LaserScan
from features.se2 import TWO_PI, Array


def range_step(ranges: Array, rules: NoiseRules) -> float:
    """Largest step of which most ranges, shape (n,) [m], are whole multiples, but for one offset; 0 for none [m].

    With a step of q the error of a range has the variance q^2 / 12 at least (eq. M109).
    """
    # A sample shows it as well as all of them.
    units = np.rint(ranges[:: len(ranges) // rules.sample + 1] / rules.finest_step).astype(np.int64)
    if units.size == 0:
        return 0.0
    for step in range(rules.most_steps, 1, -1):
        counts = np.bincount(units % step, minlength=step)
        if counts.max() < rules.on_step * units.size:
            continue
        on_step = units[units % step == counts.argmax()]
        if len(np.unique(on_step)) >= rules.fewest_multiples:
            return step * rules.finest_step
    return 0.0


def no_return_range(scans: Sequence[LaserScan], step: float, rules: NoiseRules) -> tuple[float, float] | None:
    """Range that a scanner reports where it sees nothing, and the limit below it; None where there is none [m].

    It is the most frequent of the larger ranges, with hardly any beyond it, at which one scan has more arcs than a few
    walls could make (eq. M110).

    Parameters
    ----------
    scans : finite ranges beyond any limit count.
    step : step of the ranges; 0 where there is none [m].
    rules : see there.
    """
    width = max(step, rules.finest_step)
    finite = [scan.ranges[np.isfinite(scan.ranges) & (scan.ranges > 0.0)] for scan in scans]
    ranges = np.concatenate([np.empty(0), *finite])
    if ranges.size == 0:
        return None
    cells, counts = np.unique(np.rint(ranges[ranges > 0.5 * ranges.max()] / width), return_counts=True)
    value = float(cells[counts.argmax()]) * width
    # Rounding may spread it over the neighbouring step.
    at_value = int((np.abs(ranges - value) < 1.5 * width).sum())
    beyond = int((ranges >= value + 1.5 * width).sum())
    if beyond > rules.beyond * at_value:
        return None
    most = max(_walls_at(scan, value, 1.5 * width) for scan in scans)
    return (value, value - 1.5 * width) if most >= rules.walls_at_once else None


def _walls_at(scan: LaserScan, value: float, half_width: float) -> float:
    """Walls that it would take, were they walls, for all that a scan shows of a ring of a range.

    A wall passes through the ring in two arcs at most; touching it from within, in one of a limited angle.
    """
    order = np.argsort(scan.angles % TWO_PI, kind="stable")
    at_value = np.abs(scan.ranges[order] - value) < half_width
    if not at_value.any():
        return 0.0
    begins = np.flatnonzero(at_value & ~np.roll(at_value, 1))
    if not begins.size:
        return math.inf
    ends = np.flatnonzero(at_value & ~np.roll(at_value, -1))
    angles = scan.angles[order] % TWO_PI
    arcs = (angles[np.roll(ends, -1) if ends[0] < begins[0] else ends] - angles[begins]) % TWO_PI
    return float(np.maximum(0.5, arcs / (2.0 * math.sqrt(4.0 * half_width / value))).sum())
