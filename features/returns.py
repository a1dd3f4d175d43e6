# pyright: standard
"""Which ranges are returns, for compiled code; :meth:`features.sensor.SensorModel.returned` says it of arrays."""

from features.compiled import inner


@inner(forceinline=True)
def is_return(measured, range_min, range_max):
    """Whether a range, or each of an array, is positive and within the limits of the sensor [m]."""
    return (measured > 0.0) & (measured >= range_min) & (measured <= range_max)
