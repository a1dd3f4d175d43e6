"""Packet formats by the type of their answer."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from drivers.rplidar.codecs import capsule, dense, express, hq, standard, ultra, ultra_dense
from drivers.rplidar.codecs.samples import Flags, Packets, Samples
from drivers.rplidar.protocol.answers import Answer


@dataclass(frozen=True, slots=True)
class PacketFormat:
    """Layout, check and decoding of one type of packet.

    Parameters
    ----------
    dtype : of a packet.
    samples : in a packet.
    pending : packets that must follow a packet before it is decoded.
    intact : checks packets, shape (n,).
    measure : unpacks the first n of n + 1 capsules without their angles; None for packets that are no capsules.
    unpack : unpacks packets, shape (n,), given the number of the first; None for capsules.
    """

    dtype: np.dtype
    samples: int
    pending: int = 1
    intact: Callable[[Packets], Flags] = capsule.intact
    measure: Callable[[Packets], capsule.Measured] | None = None
    unpack: Callable[[Packets, int], Samples] | None = None

    @property
    def size(self) -> int:
        """Bytes of a packet."""
        return self.dtype.itemsize

    def decode(self, packets: Packets, first: int = 0, last_encoder: float = np.nan) -> Samples:
        """Decode consecutive intact packets; of capsules all but the last, whose angles the next one determines.

        Parameters
        ----------
        packets : shape (n,), n >= 1, of capsules n >= 2.
        first : number of the first packet.
        last_encoder : encoder angle of the sample before, 64ths of a degree; NaN where there is none. For capsules.
        """
        if self.unpack is not None:
            return self.unpack(packets, first)
        assert self.measure is not None
        return capsule.decode_pairs(packets, self.measure(packets), first, last_encoder)


FORMATS: Mapping[Answer, PacketFormat] = MappingProxyType(
    {
        Answer.STANDARD: PacketFormat(
            standard.DTYPE, 1, standard.LOOKAHEAD, standard.intact, unpack=standard.decode_standard
        ),
        Answer.EXPRESS: PacketFormat(express.DTYPE, express.SAMPLES, measure=express.measure),
        Answer.HQ: PacketFormat(hq.DTYPE, hq.SAMPLES, 0, hq.intact, unpack=hq.decode_hq),
        Answer.ULTRA: PacketFormat(ultra.DTYPE, ultra.SAMPLES, measure=ultra.measure),
        Answer.DENSE: PacketFormat(dense.DTYPE, dense.SAMPLES, measure=dense.measure),
        Answer.ULTRA_DENSE: PacketFormat(ultra_dense.DTYPE, ultra_dense.SAMPLES, measure=ultra_dense.measure),
    }
)
"""Format of each type of answer that contains samples."""
