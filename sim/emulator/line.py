"""The serial line from a scanner to its host, and the faults that damage bytes on it."""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from drivers.rplidar import FORMATS, Answer
from sim.emulator.faults import Faults
from sim.emulator.ledger import Ledger
from sim.emulator.stream import Packet

STALL_TIME = 2.0
"""Time for which a stalled host reads nothing [s]: long enough for a fast line to overflow :data:`HOST_BUFFER`."""

HOST_BUFFER = 1 << 16
"""Size of the buffer of a serial port in the operating system of the host [bytes], that of Linux."""


@dataclass(frozen=True, slots=True, eq=False)
class _Receipt:
    """What is entered into the ledger when the last byte of a packet has arrived."""

    packet: Packet
    lost: np.ndarray
    cause: str | None
    bytes: int
    debris: int


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    time: float
    data: bytes
    receipt: _Receipt | None = None


class Line:
    """Bytes on their way to the host, in the order in which they arrive.

    Parameters
    ----------
    baud : baud rate of the line.
    faults : faults; those of the line and of the host are ``flipped-bytes``, ``lost-bytes``, ``split-reads`` and
        ``stall``.
    ledger : counts what arrives and what does not.
    """

    def __init__(self, baud: int, faults: Faults, ledger: Ledger) -> None:
        self._baud, self._faults, self._ledger = baud, faults, ledger
        self._pieces: deque[_Piece] = deque()
        self._stalled_until, self._stalled_bytes = -math.inf, 0

    def __bool__(self) -> bool:
        """Whether bytes are on their way."""
        return bool(self._pieces)

    @property
    def next_time(self) -> float:
        """Time at which the next bytes arrive [s]; inf where none are on their way."""
        return self._pieces[0].time if self._pieces else math.inf

    def send(self, data: bytes, time: float) -> float:
        """Send an answer from a time on [s]; return when its last byte has been sent [s]."""
        sent = time + len(data) * 10.0 / self._baud
        self._enqueue(data, sent, None)
        return sent

    def send_packet(self, packet: Packet, answer: Answer, *, counted: bool) -> None:
        """Send packets of a scan; they are ``counted`` in the ledger where the host has requested the scan."""
        size, data, cause = FORMATS[answer].size, packet.data, None
        lost = np.zeros(len(packet.revolutions), dtype=np.bool_)
        hit = slice(0, 0)
        if self._faults.strikes("flipped-bytes", packet.time):
            cause, rng = "flipped-bytes", self._faults.rng["flipped-bytes"]
            hit = slice(at := int(rng.integers(len(data))), at + 1)
            data = data[:at] + bytes([data[at] ^ int(rng.integers(1, 256))]) + data[at + 1 :]
        elif self._faults.strikes("lost-bytes", packet.time):
            cause, rng = "lost-bytes", self._faults.rng["lost-bytes"]
            at, count = int(rng.integers(len(data))), int(rng.integers(1, 21))
            hit = slice(at, min(at + count, len(data)))
            data = data[: hit.start] + data[hit.stop :]
        lost[np.arange(hit.start, hit.stop) // size] = True
        debris = int(lost.sum()) * size - len(packet.data) + len(data)
        receipt = _Receipt(packet, lost, cause, hit.stop - hit.start, debris)
        self._enqueue(data, packet.time, receipt if counted else None)

    def take(self) -> tuple[float, bytes]:
        """Take the next bytes, with the time at which they arrive [s]."""
        piece = self._pieces.popleft()
        if piece.receipt is not None:
            self._count(piece.receipt)
        return piece.time, piece.data

    def cut(self, keep: int = 0) -> bytes:
        """Remove all bytes that are on their way; return the first ``keep`` of them."""
        rest = b"".join(piece.data for piece in self._pieces)[:keep]
        self._pieces.clear()
        return rest

    def _enqueue(self, data: bytes, time: float, receipt: _Receipt | None) -> None:
        if self._faults.strikes("stall", time):
            self._stalled_until, self._stalled_bytes = time + STALL_TIME, 0
            self._ledger.loss("stall").events += 1
        if time < self._stalled_until:
            self._stalled_bytes += len(data)
            if self._stalled_bytes > HOST_BUFFER:
                if receipt is not None:
                    packet = receipt.packet
                    receipt = _Receipt(packet, np.ones_like(receipt.lost), "stall", len(packet.data), 0)
                data = b""
        first, start = time - len(data) * 10.0 / self._baud, 0
        if "split-reads" in self._faults:
            while len(data) - start > (size := int(self._faults.rng["split-reads"].integers(1, 17))):
                start += size
                self._append(data[start - size : start], first + start * 10.0 / self._baud, None)
                self._ledger.loss("split-reads").events += 1
        self._append(data[start:], time, receipt)

    def _append(self, data: bytes, time: float, receipt: _Receipt | None) -> None:
        """Add a piece, which arrives after those that are on their way, and not while the host is stalled."""
        last = self._pieces[-1].time if self._pieces else -math.inf
        release = self._stalled_until if time >= self._stalled_until - STALL_TIME else -math.inf
        self._pieces.append(_Piece(max(time, last, release), data, receipt))

    def _count(self, receipt: _Receipt) -> None:
        packet, cause = receipt.packet, receipt.cause
        if cause is not None:
            loss = self._ledger.loss(cause)
            loss.events += cause != "stall"  # which was counted at its start
            loss.bytes, loss.debris = loss.bytes + receipt.bytes, loss.debris + receipt.debris
        for name in packet.struck:
            self._ledger.loss(name).events += 1
        if packet.zeroed:
            self._ledger.loss("zero-sectors").samples += packet.zeroed
        if packet.capsule:
            self._ledger.packet(packet.revolutions.reshape(-1), packet.follows, cause)
        else:
            self._ledger.nodes(packet.revolutions, packet.follows, receipt.lost, cause)
