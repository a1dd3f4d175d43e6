"""NIS against its bounds: a filter that keeps what it promises passes; too much or too little does not."""

import numpy as np
import pytest
from scipy.stats import chi2

from slam.trust.nis import NisMonitor
from slam.trust.rules import TrustRules

PAIRS = 8
WINDOW, LEVEL = TrustRules().window, TrustRules().level


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(8)


def gated(rng: np.random.Generator, inflation: float, updates: int, probability: float) -> NisMonitor:
    """NIS of updates whose pairs, each chi-square with two degrees of freedom and inflated, passed the gate."""
    watch = NisMonitor(probability, WINDOW, LEVEL)
    for _ in range(updates):
        pairs = inflation * rng.chisquare(2, PAIRS)
        passed = pairs[pairs <= chi2.ppf(probability, 2)]
        watch.add(float(passed.sum()), len(passed))
    return watch


@pytest.mark.parametrize("probability", [0.9, 0.99])
def test_what_the_gate_takes_off_is_allowed_for(rng: np.random.Generator, probability: float) -> None:
    summary = gated(rng, 1.0, 3000, probability).summary()
    assert summary is not None
    # 24,000 pairs of variance 4 or less: a standard deviation of the mean per degree of freedom below 0.7 %, four here.
    assert summary.per_dof == pytest.approx(1.0, abs=0.028)
    assert summary.windows == 3000 - WINDOW + 1
    # Of windows that overlap about 60 are independent; at 99.99 % none is expected outside.
    assert (summary.above, summary.below) == (0.0, 0.0)


@pytest.mark.parametrize(("inflation", "above"), [(1.8, True), (0.6, False)])
def test_a_filter_that_promises_too_much_or_too_little_leaves_its_bounds(
    rng: np.random.Generator, inflation: float, above: bool
) -> None:
    summary = gated(rng, inflation, 500, 0.99).summary()
    assert summary is not None
    assert (summary.above > 0.5, summary.below > 0.5) == (above, not above)


def test_too_much_is_told_where_windows_without_a_common_update_show_it() -> None:
    watch = NisMonitor(0.99, WINDOW, LEVEL)
    assert watch.summary() is None
    assert not any(watch.add(1000.0, PAIRS) for _ in range(2 * WINDOW - 1))
    assert not watch.add(0.0, 0)
    assert watch.add(1000.0, PAIRS)


def test_what_errs_together_in_one_window_is_not_told() -> None:
    watch = NisMonitor(0.99, WINDOW, LEVEL)
    assert not any(watch.add(3.0 * 2 * PAIRS if k < WINDOW // 2 else 2 * PAIRS, PAIRS) for k in range(4 * WINDOW))
    summary = watch.summary()
    assert summary is not None
    assert summary.above > 0.0


@pytest.mark.parametrize("probability", [0.9, 0.99])
@pytest.mark.parametrize("pairs", [1, 8])
def test_a_window_is_judged_by_chi_square_of_its_degrees_of_freedom_less_what_the_gate_takes_off(
    probability: float, pairs: int
) -> None:
    """The oracle takes what the gate leaves of the mean of a pair by numerical integration."""
    gate = chi2.ppf(probability, 2)
    mean = chi2.expect(lambda nis: nis, (2,), ub=gate, conditional=True)
    dof = 2 * pairs * WINDOW
    low, high = (chi2.ppf(level, dof) * mean / 2.0 for level in ((1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0))
    for nis, expected in [
        (low * (1.0 - 1e-6), (0.0, 1.0)),
        (low * (1.0 + 1e-6), (0.0, 0.0)),
        (high * (1.0 - 1e-6), (0.0, 0.0)),
        (high * (1.0 + 1e-6), (1.0, 0.0)),
    ]:
        watch = NisMonitor(probability, WINDOW, LEVEL)
        for _ in range(WINDOW):
            watch.add(float(nis) / WINDOW, pairs)
        summary = watch.summary()
        assert summary is not None
        assert (summary.windows, summary.level) == (1, LEVEL)
        assert (summary.above, summary.below) == expected
        assert summary.per_dof == pytest.approx(nis / dof / (mean / 2.0), rel=1e-6)


def test_updates_without_a_pair_count_for_nothing() -> None:
    watch = NisMonitor(0.99, WINDOW, LEVEL)
    for _ in range(WINDOW):
        watch.add(2.0 * PAIRS, PAIRS)
        watch.add(0.0, 0)
    summary = watch.summary()
    assert summary is not None
    assert (summary.windows, summary.above, summary.below) == (1, 0.0, 0.0)


def test_single_updates_far_off_that_share_no_window_are_not_told() -> None:
    """Each takes all windows that it is in above their bounds, one fewer than would be told, and then all is well."""
    watch = NisMonitor(0.99, WINDOW, LEVEL)
    for k in range(10 * WINDOW):
        assert not watch.add(1e4 if k % (2 * WINDOW) == 0 else 2.0 * PAIRS, PAIRS)
    summary = watch.summary()
    assert summary is not None
    assert 0.4 < summary.above < 0.6
