"""Derivatives by finite differences: the one checker of every analytic Jacobian."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def finite_difference(
    function: Callable[[Array], ArrayLike],
    at: ArrayLike,
    step: float = 1e-3,
    difference: Callable[[Array, Array], Array] = np.subtract,
) -> Array:
    """Jacobian of a function by the central difference of fourth order.

    With the default step and a function whose values and derivatives are of the order of one, the error of the formula,
    step^4 f''''' / 30, and the rounding, 1e-16 / step, are both below 1e-12.

    Parameters
    ----------
    function : takes shape (n,), returns a number or shape (m,).
    at : where to differentiate, shape (n,).
    step : half the distance between the inner two of the four points.
    difference : how two values are subtracted; to be given where a value is an angle that may wrap.

    Returns
    -------
    shape (m, n).
    """
    at = np.array(at, dtype=np.float64)

    def central(column: int, width: float) -> Array:
        after, before = at.copy(), at.copy()
        after[column] += width
        before[column] -= width
        return difference(np.atleast_1d(function(after)), np.atleast_1d(function(before))) / (2.0 * width)

    columns = [(4.0 * central(k, step) - central(k, 2.0 * step)) / 3.0 for k in range(at.size)]
    return np.stack(columns, axis=-1)


def assert_jacobian(
    analytic: ArrayLike,
    function: Callable[[Array], ArrayLike],
    at: ArrayLike,
    tolerance: float = 1e-9,
    step: float = 1e-3,
    difference: Callable[[Array, Array], Array] = np.subtract,
) -> None:
    """Assert that ``analytic``, shape (m, n), is the Jacobian of ``function`` at ``at``, to a tolerance.

    The tolerance is relative to the largest entry, and absolute where all are below one.
    """
    expected = finite_difference(function, at, step, difference)
    analytic = np.asarray(analytic, dtype=np.float64)
    assert analytic.shape == expected.shape
    np.testing.assert_allclose(analytic, expected, rtol=0.0, atol=tolerance * max(1.0, np.abs(expected).max()))
