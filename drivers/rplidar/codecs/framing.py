"""Finds intact packets in a stream of bytes that may be damaged."""

import re

import numpy as np

from drivers.counts import Counts
from drivers.rplidar.codecs import standard
from drivers.rplidar.codecs.formats import FORMATS, PacketFormat
from drivers.rplidar.codecs.samples import Flags, Packets
from drivers.rplidar.protocol.answers import Answer

BLOCK = 1 << 16
"""Bytes that are framed at once; after damage the rest of them is framed again."""

SIZE = standard.DTYPE.itemsize
LOOKAHEAD = standard.LOOKAHEAD

CAPSULE_SYNC = re.compile(rb"[\xa0-\xaf](?:[\x50-\x5f]|\Z)")
HQ_SYNC = re.compile(rb"\xa5")

Stretch = tuple[Packets, bool]
"""Consecutive packets, and whether bytes are missing before the first."""


def framer(answer: Answer) -> "CheckedFramer | NodeFramer":
    """Make the framer for the packets of an answer."""
    if answer is Answer.STANDARD:
        return NodeFramer()
    return CheckedFramer(FORMATS[answer], HQ_SYNC if answer is Answer.HQ else CAPSULE_SYNC)


class CheckedFramer:
    """Frames packets that have a checksum.

    After a damaged packet framing continues at the next intact one. If that is not a whole number of packets further,
    the sync of another must follow it: 8 bits of checksum are right by chance once in a few hundred candidates.

    Parameters
    ----------
    packet_format : of the packets.
    sync : pattern of the first bytes of a packet; at the end of the data its first byte alone matches.

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
        """Add bytes, and return the packets that are complete with them."""
        found: list[Stretch] = []
        for start in range(0, len(data), BLOCK):
            self._rest = self._frame(self._rest + data[start : start + BLOCK], found)
        return found

    def _frame(self, buffer: bytes, found: list[Stretch]) -> bytes:
        """Append the packets that are found; return the bytes of an incomplete one."""
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

    def _search(self, buffer: bytes, start: int) -> int:
        """Find the next intact packet, or the first that more bytes may complete, from ``start`` on."""
        size, errors, found = self._format.size, 0, len(buffer)
        for match in self._sync.finditer(buffer, start):
            at = match.start()
            end = at + size
            unaligned = (self._skipped + at - start) % size > 0
            if end + 2 * unaligned > len(buffer):
                found = at
                break
            if self._format.intact(np.frombuffer(buffer, self._format.dtype, 1, at))[0]:
                if not unaligned or self._sync.match(buffer, end):
                    found, self._lost = at, False
                    break
            else:
                errors += not unaligned
        self._skipped += found - start
        self.counts += Counts(dropped_bytes=found - start, checksum_errors=errors)
        return found


class NodeFramer:
    """Frames standard nodes, which have two check bits and no checksum.

    A node is returned when the check bits of the :data:`LOOKAHEAD` nodes after it are right. A node with wrong check
    bits is skipped if those of as many nodes after it are right; else bytes were lost or added before it, and framing
    continues at the first byte from which on as many nodes are right.

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
        """Add bytes, and return the nodes that are confirmed with them."""
        found: list[Stretch] = []
        for start in range(0, len(data), BLOCK):
            self._rest = self._frame(self._rest + data[start : start + BLOCK], found)
        return found

    def _frame(self, buffer: bytes, found: list[Stretch]) -> bytes:
        """Append the packets that are found; return the bytes of an incomplete one."""
        at = 0
        valid = _is_node_start(buffer)
        chains = _chains(valid)
        while True:
            if not self._aligned:
                start = at + _leading(~chains[at:])
                self._drop(start - at)
                at = start
                if at >= len(chains):
                    return buffer[at:]
                self._aligned = True
            nodes = valid[at : len(buffer) - SIZE + 1 : SIZE]
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
            start = undecided + 1 + _leading(~chains[undecided + 1 : damaged + 1])
            self._aligned = start <= damaged
            whole = (start - at) // SIZE if self._aligned else max(count - 1, 0)
            self._take(buffer, at, at + whole * SIZE, found)
            self._drop(start - at - whole * SIZE)
            at = start

    def _take(self, buffer: bytes, start: int, end: int, found: list[Stretch]) -> None:
        if end > start:
            nodes = np.frombuffer(buffer, standard.DTYPE, (end - start) // SIZE, start)
            found.append((nodes, self._gap))
            self.counts += Counts(packets=len(nodes))
            self._gap = False

    def _drop(self, count: int) -> None:
        self.counts += Counts(dropped_bytes=count)
        self._gap |= count > 0


def _is_node_start(buffer: bytes) -> Flags:
    """Whether the check bits of a node that starts there are right, for each byte but the last."""
    content = np.frombuffer(buffer, np.uint8)
    head, angle = content[:-1], content[1:]
    return ((head ^ (head >> 1)) & angle & 1).astype(np.bool_)


def _chains(valid: Flags) -> Flags:
    """Whether a node and the next ones are valid, for each byte from which on they are complete."""
    count = max(len(valid) - SIZE * (LOOKAHEAD - 1), 0)
    chains = np.ones(count, dtype=np.bool_)
    for k in range(LOOKAHEAD):
        chains &= valid[k * SIZE : k * SIZE + count]
    return chains


def _leading(flags: Flags) -> int:
    """Count the leading true values."""
    return len(flags) if flags.all() else int(flags.argmin())
