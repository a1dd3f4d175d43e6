"""What became of the bytes of a scanner."""

from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class Counts:
    """Counts since the begin; they add up.

    Parameters
    ----------
    packets : intact packets.
    dropped_bytes : bytes that belong to no intact packet.
    checksum_errors : packets that were there but did not pass their check.
    discontinuities : packets that did not follow the one before, though nothing between them was dropped here.
    restarts : times the device lost its angle after the begin of a scan.
    revolutions : turns from begin to end.
    patchy_revolutions : those among them that lack packets in between.
    broken_revolutions : what would have been one by its begin and end, but not by its duration; not among them.
    dropped_revolutions : those among them that nobody took in time.
    reconnects : times the device was lost and found again.
    """

    packets: int = 0
    dropped_bytes: int = 0
    checksum_errors: int = 0
    discontinuities: int = 0
    restarts: int = 0
    revolutions: int = 0
    patchy_revolutions: int = 0
    broken_revolutions: int = 0
    dropped_revolutions: int = 0
    reconnects: int = 0

    def __add__(self, other: Self) -> Self:
        return type(self)(*(getattr(self, name) + getattr(other, name) for name in self.__slots__))
