"""Rejects values that jump away from a running mean."""

TOLERANCE = 0.5
"""Largest deviation from the mean that is accepted, as a share of the mean."""

WEIGHT = 0.1
"""Weight of a new value in the exponential running mean."""

PATIENCE = 3
"""Rejected values in a row after which the last of them is accepted as the new mean."""


class OutlierFilter:
    """Accepts the values of a slowly changing quantity, and rejects outliers.

    A value is an outlier if it deviates from the exponential running mean of the accepted values by more than
    :data:`TOLERANCE` of it. The last of :data:`PATIENCE` outliers in a row is a change: it is accepted.
    """

    def __init__(self) -> None:
        self._mean: float | None = None
        self._rejected = 0

    def accepts(self, value: float) -> bool:
        """Add a value, and return whether it is accepted."""
        if self._mean is None:
            self._mean = value
        elif abs(value - self._mean) <= TOLERANCE * self._mean:
            self._mean += WEIGHT * (value - self._mean)
        else:
            self._rejected += 1
            if self._rejected < PATIENCE:
                return False
            self._mean = value
        self._rejected = 0
        return True
