"""Common parts of all capsules: sync nibbles with a checksum, and the interpolation of angles between capsules."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drivers.rplidar.codecs.samples import RADIANS_PER_Q6, TURN_Q6, Flags, Packets, Samples, to_q6
from features.se2 import Array

HEAD = [("sync", "u1", 2), ("start", "<u2")]
"""``sync``: 0xA and 0x5 above the nibbles of the checksum. ``start``: q6 of the first sample, bit 15 a restart."""

RESTART = 0x8000


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Contents of capsules except their angles, shape (n, samples of a capsule) each.

    Parameters
    ----------
    ranges : [m]; 0 for no return.
    qualities : strength of the return, 0 to 255.
    offsets : clockwise angle by which each sample lags behind the encoder [rad]; None where the device corrects it.
    """

    ranges: Array
    qualities: npt.NDArray[np.uint8]
    offsets: Array | None = None


def new_capsule(dtype: np.dtype, start_angle: float, restart: bool) -> Packets:
    """Make an empty capsule, shape (1,), with a start angle [rad]."""
    capsule = np.zeros(1, dtype)
    capsule["start"] = to_q6(start_angle) | (RESTART if restart else 0)
    return capsule


def seal(capsule: Packets) -> bytes:
    """Add sync nibbles and checksum to a capsule, and return its bytes."""
    checksum = _checksums(capsule)
    capsule["sync"][:, 0] = 0xA0 | checksum & 0x0F
    capsule["sync"][:, 1] = 0x50 | checksum >> 4
    return capsule.tobytes()


def intact(capsules: Packets) -> Flags:
    """Whether sync nibbles and checksum of each capsule are right."""
    low, high = capsules["sync"].T
    return (low >> 4 == 0xA) & (high >> 4 == 0x5) & (low & 0x0F | (high & 0x0F) << 4 == _checksums(capsules))


def restarts(capsules: Packets) -> Flags:
    """Whether the device lost its angle, or started to scan, at each capsule."""
    return capsules["start"] >= RESTART


def starts_q6(capsules: Packets) -> npt.NDArray[np.int64]:
    """Angle of the encoder at the first sample of each capsule, 64ths of a degree."""
    return (capsules["start"] & ~np.uint16(RESTART)).astype(np.int64) % TURN_Q6


def last_encoder_q6(capsules: Packets, samples: int) -> float:
    """Return the encoder angle of the last sample whose angle these capsules determine, 64ths of a degree."""
    start, end = starts_q6(capsules[-2:])
    return (start + (end - start) % TURN_Q6 * (samples - 1) / samples) % TURN_Q6


def decode_pairs(capsules: Packets, measured: Measured, first: int, last_encoder: float) -> Samples:
    """Interpolate the angles of the samples of all capsules but the last, between its start and that of the next.

    A sample whose encoder angle is smaller than the one before starts a revolution.

    Parameters
    ----------
    capsules : consecutive ones, shape (n + 1,).
    measured : their samples, n rows.
    first : number of the first capsule.
    last_encoder : encoder angle of the sample before, 64ths of a degree; NaN where there is none.
    """
    count: int = measured.ranges.shape[1]
    starts = starts_q6(capsules)
    turned = (starts[1:] - starts[:-1]) % TURN_Q6
    encoder = (starts[:-1, None] + (turned[:, None] * np.arange(count)) / count).reshape(-1)
    encoder -= TURN_Q6 * (encoder >= TURN_Q6)
    angles = encoder * RADIANS_PER_Q6
    if measured.offsets is not None:
        angles = (angles - measured.offsets.reshape(-1)) % (2.0 * np.pi)
    return Samples(
        angles_clockwise=angles,
        ranges=measured.ranges.reshape(-1),
        qualities=measured.qualities.reshape(-1),
        starts=encoder < np.concatenate([[last_encoder], encoder[:-1]]),
        packets=np.repeat(np.arange(first, first + len(turned)), count),
    )


def _checksums(capsules: Packets) -> npt.NDArray[np.uint8]:
    """Exclusive or of all bytes after the sync, shape (n,)."""
    content = np.ascontiguousarray(capsules).view(np.uint8).reshape(len(capsules), capsules.dtype.itemsize)
    return np.bitwise_xor.reduce(content[:, 2:], axis=1)
