"""Finds the answer to a request among samples of an earlier scan, boot messages and whatever else comes before it."""

from collections.abc import Mapping

from drivers.rplidar.protocol.answers import DESCRIPTOR_SIZE, DESCRIPTOR_SYNC, Answer, Descriptor

MAX_SIZE = 256
"""Bytes of the longest answer of no fixed size that is believed."""


class AnswerSearch:
    """Takes bytes in until the answer is there; never raises, whatever the bytes.

    Parameters
    ----------
    sizes : types of the answer that are accepted, with the bytes of a packet; None where they vary.
    multiple : the answer is a stream of packets; it is there when its descriptor is.

    Attributes
    ----------
    descriptor : of the answer, once it is there.
    payload : of the answer, empty where it is a stream.
    skipped : the bytes before the answer, so far.
    """

    def __init__(self, sizes: Mapping[Answer, int | None], *, multiple: bool = False) -> None:
        self._sizes = sizes
        self._multiple = multiple
        self._buffer = b""
        self.descriptor: Descriptor | None = None
        self.payload = b""
        self.skipped = b""

    def feed(self, data: bytes) -> bool:
        """Take bytes in and say whether the answer is there."""
        self._buffer += data
        while self.descriptor is None:
            begin = self._buffer.find(DESCRIPTOR_SYNC)
            if begin < 0:
                begin = len(self._buffer) - self._buffer.endswith(DESCRIPTOR_SYNC[:1])
            self._skip(begin)
            if len(self._buffer) < DESCRIPTOR_SIZE:
                return False
            descriptor = Descriptor.unpack(self._buffer[:DESCRIPTOR_SIZE])
            if descriptor is None or not self._expected(descriptor):
                self._skip(1)
                continue
            end = DESCRIPTOR_SIZE + (0 if self._multiple else descriptor.size)
            if len(self._buffer) < end:
                return False
            self.descriptor = descriptor
            self.payload, self._buffer = self._buffer[DESCRIPTOR_SIZE:end], self._buffer[end:]
        return True

    @property
    def rest(self) -> bytes:
        """Bytes behind the answer: the first samples, where it is a stream."""
        return self._buffer if self.descriptor is not None else b""

    def _expected(self, descriptor: Descriptor) -> bool:
        if descriptor.kind not in self._sizes or descriptor.multiple != self._multiple:
            return False
        size = self._sizes[Answer(descriptor.kind)]
        return descriptor.size <= MAX_SIZE if size is None else descriptor.size == size

    def _skip(self, count: int) -> None:
        self.skipped += self._buffer[:count]
        self._buffer = self._buffer[count:]
