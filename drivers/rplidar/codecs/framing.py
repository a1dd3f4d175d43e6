"""Finds intact packets in a stream of bytes, whatever else the stream holds."""

import re

import numpy as np

from drivers.counts import Counts
from drivers.rplidar.codecs import standard
from drivers.rplidar.codecs.formats import FORMATS, PacketFormat
from drivers.rplidar.codecs.samples import Flags, Packets
from drivers.rplidar.protocol.answers import Answer

BLOCK = 1 << 16
"""Bytes looked at together: after damage, the rest of them is looked at again."""

SIZE = standard.DTYPE.itemsize
LOOKAHEAD = standard.LOOKAHEAD

CAPSULE_SYNC = re.compile(rb"[\xa0-\xaf](?:[\x50-\x5f]|\Z)")
HQ_SYNC = re.compile(rb"\xa5")

Stretch = tuple[Packets, bool]
"""Packets that follow each other, and whether something is missing before the first."""


def framer(answer: Answer) -> "CheckedFramer | NodeFramer":
    """Framer for the packets of an answer."""
    if answer is Answer.STANDARD:
        return NodeFramer()
    return CheckedFramer(FORMATS[answer], HQ_SYNC if answer is Answer.HQ else CAPSULE_SYNC)


class CheckedFramer:
    """Frames packets that carry a checksum.

    Behind one that does not fit, the stream goes on with the next that does. Where it lies askew of those before, the
    begin of another must follow: 8 bits of checksum fit by chance once in a few hundred packets.

    Parameters
    ----------
    packet_format : of the packets.
    sync : what a packet begins with; the end of the data may stand for all but its first byte.

    Attributes
    ----------
    counts : packets, dropped bytes and checksum errors so far.
    """

    def __init__(self, packet_format: PacketFormat, sync: re.Pattern[bytes]) -> None:
        self.counts = Counts()
        self._format = packet_format
        self._sync = sync
        self._rest = b""
        self._lost = False
        self._skipped = 0  # bytes since the last intact packet

    def feed(self, data: bytes) -> list[Stretch]:
        """Take bytes in and return the packets that are complete with them."""
        found: list[Stretch] = []
        for begin in range(0, len(data), BLOCK):
            self._rest = self._frame(self._rest + data[begin : begin + BLOCK], found)
        return found

    def _frame(self, buffer: bytes, found: list[Stretch]) -> bytes:
        """Append what is found; return the bytes that wait for more."""
        at, size = 0, self._format.size
        while True:
            if self._lost:
                at = self._search(buffer, at)
                if self._lost:
                    return buffer[at:]
            packets = np.frombuffer(buffer, self._format.dtype, (len(buffer) - at) // size, at)
            count = _leading(self._format.intact(packets))
            if count:
                found.append((packets[:count], self._skipped > 0))
                self.counts += Counts(packets=count)
                self._skipped = 0
                at += count * size
            if count == len(packets):
                return buffer[at:]
            self._lost = True

    def _search(self, buffer: bytes, begin: int) -> int:
        """Find where the stream goes on, or may go on when more is there."""
        size, errors, found = self._format.size, 0, len(buffer)
        for match in self._sync.finditer(buffer, begin):
            at = match.start()
            end = at + size
            askew = (self._skipped + at - begin) % size > 0
            if end + 2 * askew > len(buffer):
                found = at
                break
            if self._format.intact(np.frombuffer(buffer, self._format.dtype, 1, at))[0]:
                if not askew or self._sync.match(buffer, end):
                    found, self._lost = at, False
                    break
            else:
                errors += not askew
        self._skipped += found - begin
        self.counts += Counts(dropped_bytes=found - begin, checksum_errors=errors)
        return found


class NodeFramer:
    """Frames standard nodes, which have two check bits and no checksum.

    A node is given when :data:`LOOKAHEAD` behind it hold. One that does not hold is passed over if as many behind it
    do; else bytes were lost or added before, and the stream goes on with the first node that begins such a chain.

    Attributes
    ----------
    counts : packets and dropped bytes so far.
    """

    def __init__(self) -> None:
        self.counts = Counts()
        self._rest = b""
        self._aligned = True
        self._gap = False

    def feed(self, data: bytes) -> list[Stretch]:
        """Take bytes in and return the nodes that are known to be whole with them."""
        found: list[Stretch] = []
        for begin in range(0, len(data), BLOCK):
            self._rest = self._frame(self._rest + data[begin : begin + BLOCK], found)
        return found

    def _frame(self, buffer: bytes, found: list[Stretch]) -> bytes:
        """Append what is found; return the bytes that wait for more."""
        at = 0
        holds = _node_begins(buffer)
        chains = _chains(holds)
        while True:
            if not self._aligned:
                begin = at + _leading(~chains[at:])
                self._drop(begin - at)
                at = begin
                if at >= len(chains):
                    return buffer[at:]
                self._aligned = True
            nodes = holds[at : len(buffer) - SIZE + 1 : SIZE]
            count = _leading(nodes)
            damaged = at + count * SIZE
            undecided = max(at, damaged - SIZE * LOOKAHEAD)
            if count == len(nodes) or damaged + SIZE >= len(chains):
                self._take(buffer, at, undecided, found)
                return buffer[undecided:]
            if chains[damaged + SIZE]:
                self._take(buffer, at, damaged, found)
                at = damaged + SIZE
                self._drop(SIZE)
                continue
            begin = undecided + 1 + _leading(~chains[undecided + 1 : damaged + 1])
            self._aligned = begin <= damaged
            whole = (begin - at) // SIZE if self._aligned else max(count - 1, 0)
            self._take(buffer, at, at + whole * SIZE, found)
            self._drop(begin - at - whole * SIZE)
            at = begin

    def _take(self, buffer: bytes, begin: int, end: int, found: list[Stretch]) -> None:
        if end > begin:
            nodes = np.frombuffer(buffer, standard.DTYPE, (end - begin) // SIZE, begin)
            found.append((nodes, self._gap))
            self.counts += Counts(packets=len(nodes))
            self._gap = False

    def _drop(self, count: int) -> None:
        self.counts += Counts(dropped_bytes=count)
        self._gap |= count > 0


def _node_begins(buffer: bytes) -> Flags:
    """Whether the check bits of a node hold at each byte but the last."""
    content = np.frombuffer(buffer, np.uint8)
    head, angle = content[:-1], content[1:]
    return ((head ^ (head >> 1)) & angle & 1).astype(np.bool_)


def _chains(holds: Flags) -> Flags:
    """Whether this node and those behind it hold, as far as the data reach."""
    count = max(len(holds) - SIZE * (LOOKAHEAD - 1), 0)
    chains = np.ones(count, dtype=np.bool_)
    for k in range(LOOKAHEAD):
        chains &= holds[k * SIZE : k * SIZE + count]
    return chains


def _leading(flags: Flags) -> int:
    """How many are true before the first that is not."""
    return len(flags) if flags.all() else int(flags.argmin())
