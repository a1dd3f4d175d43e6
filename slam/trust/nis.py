"""Consistency test of the filter: NIS of a sliding window of updates against its chi-square bounds."""

import functools
from collections import deque
from dataclasses import dataclass

from scipy.stats import chi2


@dataclass(frozen=True, slots=True)
class NisSummary:
    """NIS of a run; a consistent filter has 1 per degree of freedom.

    Parameters
    ----------
    per_dof : NIS of all updates per degree of freedom, relative to its expectation behind the gate.
    windows : judged, each of as many updates, one later than the other.
    above, below : share of the windows above and below their bounds: overconfident and conservative filter.
    level : two-sided level of the bounds.
    """

    per_dof: float
    windows: int
    above: float
    below: float
    level: float


@functools.cache
def _bounds(level: float, dof: int) -> tuple[float, float]:
    """Two-sided bounds of chi-square; the same few degrees of freedom are asked for again and again."""
    low, high = chi2.interval(level, dof)
    return float(low), float(high)


class NisMonitor:
    """Judges the last updates, a window of them, after each.

    The gate of the association takes off the tail of each pair's distribution, so that the expected NIS is smaller than
    its degrees of freedom (eq. M59).
    Successive updates are correlated, which the bounds neglect. A filter therefore counts as overconfident only after
    more than :data:`WINDOW` windows in a row were above their bounds; the first and last of these share no update.

    Parameters
    ----------
    match_probability : chi-square level of the gate of a pair.
    window : updates that are judged together.
    level : two-sided level of the bounds of a window.
    """

    def __init__(self, match_probability: float, window: int, level: float) -> None:
        self._window, self._level = window, level
        gate = float(chi2.ppf(match_probability, 2))
        self._kept = 1.0 - 0.5 * gate * (1.0 - match_probability) / match_probability
        self._latest: deque[tuple[float, int]] = deque(maxlen=window)
        self._total, self._dof = 0.0, 0
        self._windows = self._above = self._below = 0
        self._above_in_a_row = 0

    def add(self, nis: float, pairs: int) -> bool:
        """Add the NIS of an update of so many pairs; return whether the filter counts as overconfident."""
        if not pairs:
            return False
        self._latest.append((nis, 2 * pairs))
        self._total, self._dof = self._total + nis, self._dof + 2 * pairs
        if len(self._latest) < self._window:
            return False
        window, dof = (sum(values) for values in zip(*self._latest, strict=True))
        low, high = _bounds(self._level, dof)
        above, below = window > self._kept * high, window < self._kept * low
        self._windows += 1
        self._above += bool(above)
        self._below += bool(below)
        self._above_in_a_row = self._above_in_a_row + 1 if above else 0
        return self._above_in_a_row > self._window

    def summary(self) -> NisSummary | None:
        """Figures so far; None where nothing was matched."""
        if not self._dof:
            return None
        windows = max(self._windows, 1)
        per_dof = self._total / (self._kept * self._dof)
        return NisSummary(per_dof, self._windows, self._above / windows, self._below / windows, self._level)
