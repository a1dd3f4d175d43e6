"""Standard nodes, answer 0x81: one sample in 5 bytes."""

import numpy as np
import numpy.typing as npt

from drivers.rplidar.codecs.samples import RADIANS_PER_Q6, TURN_Q6, Flags, Packets, Samples, to_metres, to_q6, to_steps
from features.se2 import Array

DTYPE = np.dtype([("head", "u1"), ("angle", "<u2"), ("distance", "<u2")])
"""``head``: bit 0 S, first of a revolution; bit 1 its complement; then the quality. ``angle``: bit 0 is 1, then q6."""

LOOKAHEAD = 8
"""Nodes after a node whose check bits must be right for it to be accepted: each node has two check bits only."""


def encode_standard(angles_clockwise: Array, ranges: Array, qualities: npt.NDArray[np.uint8], starts: Flags) -> bytes:
    """Pack samples, shape (n,) each; units as in :class:`Samples`, quality in steps of 4, at most 16.38 m."""
    packets = np.zeros(len(ranges), DTYPE)
    flags = np.asarray(starts, dtype=np.uint8)
    packets["head"] = np.asarray(qualities, dtype=np.uint8) & 0xFC | (1 - flags) << 1 | flags
    packets["angle"] = to_q6(angles_clockwise) << 1 | 1
    packets["distance"] = to_steps(ranges, 4000, 0xFFFF)
    return packets.tobytes()


def intact(packets: Packets) -> Flags:
    """Whether the check bits of each packet are right."""
    head = packets["head"]
    return ((head ^ (head >> 1)) & packets["angle"] & 1).astype(np.bool_)


def decode_standard(packets: Packets, first: int = 0) -> Samples:
    """Unpack nodes, shape (n,); ``first`` is the number of the first."""
    head = packets["head"]
    return Samples(
        angles_clockwise=np.multiply((packets["angle"] >> 1) % TURN_Q6, RADIANS_PER_Q6, dtype=np.float64),
        ranges=to_metres(packets["distance"], 4000),
        qualities=head & np.uint8(0xFC),
        starts=(head & 1).astype(np.bool_),
        packets=np.arange(first, first + len(packets)),
    )
