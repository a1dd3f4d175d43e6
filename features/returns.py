# pyright: standard
"""Which ranges are returns, for compiled code; :meth:`features.sensor.SensorModel.returned` says it of arrays."""

from numba import njit


@njit(cache=True, error_model="numpy", forceinline=True)
def is_return(measured, range_min, range_max):
    """Whether a range, or each of an array, is positive and within the limits of the sensor [m]."""
    return (measured > 0.0) & (measured >= range_min) & (measured <= range_max)
