"""What all capsules share: sync nibbles with a checksum, and a start angle that the next capsule completes."""

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
    """What the capsules themselves say of their samples, shape (n, samples of a capsule) each.

    Parameters
    ----------
    ranges : [m]; 0 is no return.
    qualities : 0 to 255.
    offsets : what the angle of a sample lags behind the encoder, clockwise [rad]; None where the device has done it.
    """

    ranges: Array
    qualities: npt.NDArray[np.uint8]
    offsets: Array | None = None


def new_capsule(dtype: np.dtype, start_angle: float, restart: bool) -> Packets:
    """Capsule, shape (1,), with its start angle [rad] and nothing else."""
    capsule = np.zeros(1, dtype)
    capsule["start"] = to_q6(start_angle) | (RESTART if restart else 0)
    return capsule


def seal(capsule: Packets) -> bytes:
    """Bytes of one capsule, sync nibbles and checksum added."""
    checksum = _checksums(capsule)
    capsule["sync"][:, 0] = 0xA0 | checksum & 0x0F
    capsule["sync"][:, 1] = 0x50 | checksum >> 4
    return capsule.tobytes()


def intact(capsules: Packets) -> Flags:
    """Whether sync nibbles and checksum of each capsule hold."""
    low, high = capsules["sync"].T
    return (low >> 4 == 0xA) & (high >> 4 == 0x5) & (low & 0x0F | (high & 0x0F) << 4 == _checksums(capsules))


def restarts(capsules: Packets) -> Flags:
    """Whether the device lost its angle, or began, at each capsule."""
    return capsules["start"] >= RESTART


def starts_q6(capsules: Packets) -> npt.NDArray[np.int64]:
    """Angle of the encoder at the first sample of each capsule, 64ths of a degree."""
    return (capsules["start"] & ~np.uint16(RESTART)).astype(np.int64) % TURN_Q6


def last_encoder_q6(capsules: Packets, samples: int) -> float:
    """Find the encoder angle of the last sample that these capsules place, 64ths of a degree."""
    start, end = starts_q6(capsules[-2:])
    return (start + (end - start) % TURN_Q6 * (samples - 1) / samples) % TURN_Q6


def decode_pairs(capsules: Packets, measured: Measured, first: int, last_encoder: float) -> Samples:
    """Place the samples of all capsules but the last, whose angles are known only with the next.

    A sample whose encoder angle has wrapped since the one before starts a revolution.

    Parameters
    ----------
    capsules : consecutive ones, shape (n + 1,).
    measured : their samples, n rows.
    first : number of the first capsule.
    last_encoder : encoder angle of the sample before, 64ths of a degree; NaN where there is none.
    """
    count = measured.ranges.shape[1]
    starts = starts_q6(capsules)
    turned = (starts[1:] - starts[:-1]) % TURN_Q6
    turned_before = np.multiply(turned[:, None], np.arange(count))
    encoder: Array = np.add(starts[:-1, None], np.divide(turned_before, count)).reshape(-1)
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
    """Exclusive or of all bytes behind the sync, shape (n,)."""
    content = np.ascontiguousarray(capsules).view(np.uint8).reshape(len(capsules), capsules.dtype.itemsize)
    return np.bitwise_xor.reduce(content[:, 2:], axis=1)
