"""Tells a value that changes slowly from one that jumps."""

TOLERANCE = 0.5
WEIGHT = 0.1
PATIENCE = 3


class Steady:
    """Whether values agree with the mean of those before to within half of it.

    After :data:`PATIENCE` values in a row that do not, they are believed.
    """

    def __init__(self) -> None:
        self._mean: float | None = None
        self._jumps = 0

    def agrees(self, value: float) -> bool:
        """Take a value in."""
        if self._mean is None:
            self._mean = value
        elif abs(value - self._mean) <= TOLERANCE * self._mean:
            self._mean += WEIGHT * (value - self._mean)
        else:
            self._jumps += 1
            if self._jumps < PATIENCE:
                return False
            self._mean = value
        self._jumps = 0
        return True
