"""Finds the answer to a request among samples of an earlier scan, boot messages and whatever else comes before it."""

from drivers.rplidar.answers import DESCRIPTOR_SIZE, DESCRIPTOR_SYNC, Answer, Descriptor

MAX_SIZE = 256
"""Bytes of the longest single answer that is believed."""


class AnswerSearch:
    """Takes bytes in until the answer is there; never raises, whatever the bytes.

    Parameters
    ----------
    kinds : types of the answer that are accepted.
    size : bytes of its payload; None where it varies.
    multiple : the answer is a stream of packets; it is there when its descriptor is.

    Attributes
    ----------
    descriptor : of the answer, once it is there.
    payload : of the answer, empty where it is a stream.
    skipped : the bytes before the answer, so far.
    """

    def __init__(self, *kinds: Answer, size: int | None = None, multiple: bool = False) -> None:
        self._kinds = kinds
        self._size = size
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
        return (
            descriptor.kind in self._kinds
            and descriptor.multiple == self._multiple
            and (descriptor.size <= MAX_SIZE if self._size is None else descriptor.size == self._size)
        )

    def _skip(self, count: int) -> None:
        self.skipped += self._buffer[:count]
        self._buffer = self._buffer[count:]
