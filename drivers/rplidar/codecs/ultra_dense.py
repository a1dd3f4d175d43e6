"""Ultra-dense capsules, answer 0x86: 64 samples of 20 bits, on four scales of range and quality."""

import numpy as np
import numpy.typing as npt

from drivers.rplidar.codecs.capsule import HEAD, Measured, new_capsule, seal
from drivers.rplidar.codecs.samples import Packets, to_metres, to_steps
from features.se2 import Array

SAMPLES = 64

DTYPE = np.dtype(
    [HEAD[0], ("time", "<u4"), ("status", "<u2"), HEAD[1], ("cabin", [("low", "<u2", 2), ("high", "u1")], SAMPLES // 2)]
)
"""``cabin``: two words of 20 bits, their upper nibbles in ``high``. The lowest 2 bits of a word are its scale."""

_FIRST = np.array([0, 2046, 8187, 24567])
"""Distance at which each scale begins [mm]; its steps are of 2, 3, 4 and 5 mm, 10 to 13 bits of them."""


def encode_ultra_dense(
    start_angle: float,
    ranges: Array,
    qualities: npt.NDArray[np.uint8],
    *,
    restart: bool = False,
    time: int = 0,
    status: int = 0,
) -> bytes:
    """Pack 64 samples.

    Parameters
    ----------
    start_angle : clockwise angle of the encoder at the first sample [rad].
    ranges : shape (64,) [m]; at most 65.522 m.
    qualities : shape (64,), 0 to 255; kept in steps of 1 near, to 8 far.
    restart : whether the device lost its angle, or started to scan.
    time, status : of the device.

    Raises
    ------
    ValueError
        A range does not fit.
    """
    distances = to_steps(ranges, 1000, 24567 + 5 * 0x1FFF)
    scale = np.searchsorted(_FIRST, distances, side="right") - 1
    words = scale | (distances - _FIRST[scale]) // (scale + 2) << 2
    words |= (np.asarray(qualities, dtype=np.int64) >> scale) << (12 + scale)
    words = words.reshape(-1, 2)
    capsule = new_capsule(DTYPE, start_angle, restart)
    capsule["time"], capsule["status"] = time, status
    cabins = capsule["cabin"][0]
    cabins["low"] = words & 0xFFFF
    cabins["high"] = words[:, 0] >> 16 | (words[:, 1] >> 16) << 4
    return seal(capsule)


def measure(capsules: Packets) -> Measured:
    """Unpack the samples of all capsules but the last."""
    cabins = capsules["cabin"][:-1]
    high = cabins["high"].astype(np.uint32)
    words = (cabins["low"] | np.stack([high & 0x0F, high >> 4], axis=-1) << 16).reshape(-1, SAMPLES)
    scale = words & 3
    steps = (words & (0x1000 << scale) - 1) >> 2
    return Measured(
        ranges=to_metres(_FIRST[scale] + steps * (scale + 2), 1000),
        qualities=(words >> (12 + scale) << scale).astype(np.uint8),
    )
