"""Counts of what became of the bytes of a scanner."""

from dataclasses import dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class Counts:
    """What was received and lost since the scan began; the counts of two scans add up.

    Parameters
    ----------
    packets : intact packets.
    dropped_bytes : bytes that belong to no intact packet.
    checksum_errors : packets whose checksum failed.
    discontinuities : intact packets that do not continue the one before, although no bytes between them were dropped.
    restarts : times the scanner lost its angle after the start of a scan.
    revolutions : complete revolutions.
    patchy_revolutions : those of them in which packets are missing.
    broken_revolutions : revolutions that were discarded because their duration is wrong; not among ``revolutions``.
    dropped_revolutions : those of ``revolutions`` that were not taken in time.
    reconnects : times the scanner was lost and found again.
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
