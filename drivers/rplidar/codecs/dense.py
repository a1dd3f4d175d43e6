"""Dense capsules, answer 0x85: 40 ranges in whole millimetres, as the S1's DenseBoost sends them."""

import numpy as np

from drivers.rplidar.codecs.capsule import HEAD, Measured, new_capsule, seal
from drivers.rplidar.codecs.samples import NOMINAL_QUALITY, Packets, to_metres, to_steps
from features.se2 import Array

SAMPLES = 40

DTYPE = np.dtype([*HEAD, ("distance", "<u2", SAMPLES)])


def encode_dense(start_angle: float, ranges: Array, *, restart: bool = False) -> bytes:
    """Pack 40 samples.

    Parameters
    ----------
    start_angle : clockwise angle of the encoder at the first sample [rad].
    ranges : shape (40,) [m]; at most 65.535 m.
    restart : whether the device lost its angle, or started to scan.

    Raises
    ------
    ValueError
        A range does not fit.
    """
    capsule = new_capsule(DTYPE, start_angle, restart)
    capsule["distance"] = to_steps(ranges, 1000, 0xFFFF)
    return seal(capsule)


def measure(capsules: Packets) -> Measured:
    """Unpack the samples of all capsules but the last."""
    distances = capsules["distance"][:-1]
    return Measured(to_metres(distances, 1000), np.uint8(NOMINAL_QUALITY) * (distances > 0))
