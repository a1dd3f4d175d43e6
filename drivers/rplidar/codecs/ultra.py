"""Ultra capsules, answer 0x84: 96 samples, every third in full and the others as differences to it."""

import math

import numpy as np
import numpy.typing as npt

from drivers.rplidar.codecs.capsule import HEAD, Measured, new_capsule, seal
from drivers.rplidar.codecs.samples import NOMINAL_QUALITY, Packets, to_metres, to_steps
from features.se2 import Array

SAMPLES = 96

DTYPE = np.dtype([*HEAD, ("cabin", "<u4", SAMPLES // 3)])
"""``cabin``: 12 bits of a range on a scale of growing steps, then two differences of 10 bits in such steps."""

Steps = npt.NDArray[np.int64]

_CODES = np.array([0, 512, 1280, 1792, 3328])
_DISTANCES = np.array([0, 512, 2048, 4096, 16384])
"""Codes at which the step doubles, and the distances there [mm]."""
_LAST_DISTANCE = 28656

_NONE = -512
_DIFFERENCES = (-511, 510)
"""A difference outside of these is no return."""


def encode_ultra(start_angle: float, ranges: Array, next_range: float = 0.0, *, restart: bool = False) -> bytes:
    """Pack 96 samples; a range whose difference is too large to be encoded becomes no return.

    Parameters
    ----------
    start_angle : clockwise angle of the encoder at the first sample [rad].
    ranges : shape (96,) [m]; at most 28.656 m.
    next_range : of the first sample of the next capsule [m], which the last differences refer to.
    restart : whether the device lost its angle, or started to scan.

    Raises
    ------
    ValueError
        A range does not fit.
    """
    distances = to_steps(np.append(ranges, next_range), 1000, _LAST_DISTANCE)
    codes = _to_codes(distances[::3])
    majors, levels = _from_codes(codes)
    first = _difference(distances[1:-1:3], *_base(majors, levels))
    second = _difference(distances[2::3], majors[1:], levels[1:])
    capsule = new_capsule(DTYPE, start_angle, restart)
    capsule["cabin"] = codes[:-1] | (first & 0x3FF) << 12 | (second & 0x3FF) << 22
    return seal(capsule)


def measure(capsules: Packets) -> Measured:
    """Unpack the samples of all capsules but the last; the last differences of a capsule refer to the next one."""
    cabins = capsules["cabin"].astype(np.int64)
    majors, levels = _from_codes(np.append(cabins[:-1].reshape(-1), cabins[-1, 0]) & 0xFFF)
    words = cabins[:-1].reshape(-1)
    base, level = _base(majors, levels)
    distances = np.stack(
        [
            majors[:-1],
            _add(base, _signed(words >> 12), level),
            _add(majors[1:], _signed(words >> 22), levels[1:]),
        ],
        axis=-1,
    )
    ranges = to_metres(distances, 1000).reshape(-1, SAMPLES)
    return Measured(ranges, np.uint8(NOMINAL_QUALITY) * (ranges > 0.0), optical_offsets(ranges))


def optical_offsets(ranges: Array) -> Array:
    """Angle by which the beam of a triangulating scanner lags behind its encoder, for each range [m], [rad].

    The fixed-point polynomial of the SDK: 8 deg at infinity, 7.5 deg below 50 mm.
    """
    q2 = np.rint(np.asarray(ranges) * 4000.0).astype(np.int64)
    k = 98361 // np.maximum(q2, 200)
    far = int(math.radians(8.0) * 65536.0) - (k << 6) - k**3 // 98304
    return np.where(q2 >= 200, far, int(math.radians(7.5) * 65536.0)) / 65536.0


def _to_codes(distances: Steps) -> Steps:
    """Nearest code at or below each distance [mm]."""
    level = np.searchsorted(_DISTANCES, distances, side="right") - 1
    return np.minimum(
        _CODES[level] + ((distances - _DISTANCES[level]) >> level), np.append(_CODES[1:], 4096)[level] - 1
    )


def _from_codes(codes: Steps) -> tuple[Steps, Steps]:
    """Distance [mm] of each code, and the level of its scale, whose step is 2^level mm."""
    level = np.searchsorted(_CODES, codes, side="right") - 1
    return _DISTANCES[level] + ((codes - _CODES[level]) << level), level


def _base(majors: Steps, levels: Steps) -> tuple[Steps, Steps]:
    """Choose what the first difference of each cabin refers to: its own range or, where it has none, the next."""
    lost = (majors[:-1] == 0) & (majors[1:] != 0)
    return np.where(lost, majors[1:], majors[:-1]), np.where(lost, levels[1:], levels[:-1])


def _difference(distances: Steps, base: Steps, level: Steps) -> Steps:
    steps = (distances - base) >> level
    low, high = _DIFFERENCES
    return np.where((distances > 0) & (steps >= low) & (steps <= high), steps, _NONE)


def _signed(words: Steps) -> Steps:
    """Lowest 10 bits as a number with sign."""
    return ((words & 0x3FF) ^ 0x200) - 0x200


def _add(base: Steps, steps: Steps, level: Steps) -> Steps:
    low, high = _DIFFERENCES
    return np.where((steps >= low) & (steps <= high), np.maximum(base + (steps << level), 0), 0)
