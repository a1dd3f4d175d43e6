"""Express capsules, answer 0x82: 32 samples with angle offsets of 6 bits."""

import math

import numpy as np

from drivers.rplidar.codecs.capsule import HEAD, Measured, new_capsule, seal
from drivers.rplidar.codecs.samples import NOMINAL_QUALITY, Packets, to_metres, to_steps
from features.se2 import Array

SAMPLES = 32

DTYPE = np.dtype([*HEAD, ("cabin", [("distance", "<u2", 2), ("offsets", "u1")], SAMPLES // 2)])
"""``distance``: millimetres above the two high bits of the offset. ``offsets``: the low nibbles of two offsets."""

_RADIANS_PER_Q3 = math.radians(1.0 / 8.0)


def encode_express(start_angle: float, ranges: Array, offsets: Array, *, restart: bool = False) -> bytes:
    """Pack 32 samples.

    Parameters
    ----------
    start_angle : clockwise angle of the encoder at the first sample [rad].
    ranges : shape (32,) [m]; at most 16.383 m.
    offsets : clockwise angle by which each sample lags behind the encoder, shape (32,) [rad]; 0 to 7.875 deg.
    restart : whether the device lost its angle, or started to scan.

    Raises
    ------
    ValueError
        A range or an offset does not fit.
    """
    q3 = np.rint(np.asarray(offsets) / _RADIANS_PER_Q3).astype(np.int64).reshape(-1, 2)
    if not ((q3 >= 0) & (q3 < 64)).all():
        raise ValueError("offsets must lie between 0 and 7.875 deg to be encoded")
    capsule = new_capsule(DTYPE, start_angle, restart)
    cabins = capsule["cabin"][0]
    cabins["distance"] = to_steps(ranges, 1000, 0x3FFF).reshape(-1, 2) << 2 | q3 >> 4
    cabins["offsets"] = q3[:, 0] & 0x0F | (q3[:, 1] & 0x0F) << 4
    return seal(capsule)


def measure(capsules: Packets) -> Measured:
    """Unpack the samples of all capsules but the last; the offset has no sign (SDK, not manual)."""
    cabins = capsules["cabin"][:-1]
    words, nibbles = cabins["distance"], cabins["offsets"]
    low = np.stack([nibbles & 0x0F, nibbles >> 4], axis=-1)
    ranges = to_metres(words >> 2, 1000).reshape(-1, SAMPLES)
    offsets = np.multiply(low | (words & 3) << 4, _RADIANS_PER_Q3, dtype=np.float64).reshape(-1, SAMPLES)
    return Measured(ranges, np.uint8(NOMINAL_QUALITY) * (ranges > 0.0), offsets)
