"""HQ packets, answer 0x83: 96 samples, each with its own angle, and a CRC."""

import math
import zlib

import numpy as np
import numpy.typing as npt

from drivers.rplidar.codecs.samples import Flags, Packets, Samples, to_metres, to_steps
from features.se2 import Array

SAMPLES = 96
SYNC = 0xA5

DTYPE = np.dtype(
    [
        ("sync", "u1"),
        ("time", "<u8"),
        ("node", [("angle", "<u2"), ("distance", "<u4"), ("quality", "u1"), ("flag", "u1")], SAMPLES),
        ("crc", "<u4"),
    ]
)

_RADIANS_PER_STEP = 2.0 * math.pi / 65536.0


def crc32(data: bytes) -> int:
    """CRC of the device: that of zlib over the data, padded with 4 - (size mod 4) zeros."""
    return zlib.crc32(data + bytes(4 - len(data) % 4))


def encode_hq(
    angles_clockwise: Array, ranges: Array, qualities: npt.NDArray[np.uint8], starts: Flags, time: int = 0
) -> bytes:
    """Pack 96 samples, shape (96,) each; units as in :class:`Samples`, ``time`` of the device's clock."""
    packet = np.zeros(1, DTYPE)
    packet["sync"], packet["time"] = SYNC, time
    nodes = packet["node"][0]
    nodes["angle"] = np.rint(np.asarray(angles_clockwise) / _RADIANS_PER_STEP).astype(np.int64) % 65536
    nodes["distance"] = to_steps(ranges, 4000, 0xFFFFFFFF)
    nodes["quality"], nodes["flag"] = qualities, starts
    packet["crc"] = crc32(packet.tobytes()[:-4])
    return packet.tobytes()


def intact(packets: Packets) -> Flags:
    """Whether sync byte and CRC of each packet are right."""
    return (packets["sync"] == SYNC) & (packets["crc"] == [crc32(packet.tobytes()[:-4]) for packet in packets])


def decode_hq(packets: Packets, first: int = 0) -> Samples:
    """Unpack packets, shape (n,); ``first`` is the number of the first."""
    nodes = packets["node"].reshape(-1)
    return Samples(
        angles_clockwise=np.multiply(nodes["angle"], _RADIANS_PER_STEP, dtype=np.float64),
        ranges=to_metres(nodes["distance"], 4000),
        qualities=nodes["quality"].copy(),
        starts=(nodes["flag"] & 1).astype(np.bool_),
        packets=np.repeat(np.arange(first, first + len(packets)), SAMPLES),
    )
