"""How the noise of a scanner is measured; docs/math.md has the reason of each value."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class NoiseRules:
    """Rules of :mod:`features.noise`.

    Parameters
    ----------
    least_points : points of a line that is measured.
    fewest_lines : lines of which a median is taken, at least.
    range_share : part of the variance of its residuals that ranges cause, at least, of a line that is measured.
    usable_error, wanted_error : relative standard error of sigma_range up to which it is used, and is good enough.
    start_scans, most_scans : scans on which it is measured, and at most where these do not tell it.
    window : scans after the start from which the noise is watched.
    watched : every so many scans one is looked at afterwards.
    start : first sigma as a share of that of triples.
    rounds : extractions with the sigma of the one before, at most.
    settled : relative change of sigma_range that ends them.
    least_sigma : of a range, where the data show no noise [m].
    finest_step, most_steps : step of ranges that is looked for, and the largest as a multiple of it [m].
    on_step : share of the ranges that are whole multiples of a step.
    sample : ranges that are looked at for a step, about.
    fewest_multiples : different ranges on a step, at least.
    walls_at_once : walls that would have to touch the circle of the same range at once, were it no "no return".
    beyond : share of the ranges from a "no return" on that may lie beyond it.
    contradiction : factor between the variance in use and the one seen from which on a run says so.
    significance : standard errors of what is seen beyond that factor.
    """

    least_points: int = 12
    fewest_lines: int = 3
    range_share: float = 0.5
    usable_error: float = 0.1
    wanted_error: float = 0.025
    start_scans: int = 16
    most_scans: int = 128
    window: int = 128
    watched: int = 8
    start: float = 0.5
    rounds: int = 10
    settled: float = 0.02
    least_sigma: float = 0.001
    finest_step: float = 1e-4
    most_steps: int = 1000
    on_step: float = 2.0 / 3.0
    sample: int = 4096
    fewest_multiples: int = 20
    walls_at_once: float = 3.0
    beyond: float = 0.1
    contradiction: float = 4.0
    significance: float = 4.0
