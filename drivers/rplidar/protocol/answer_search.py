"""Finds the answer to a request among samples of an earlier scan, boot messages and other bytes."""

from collections.abc import Mapping

from drivers.rplidar.protocol.answers import DESCRIPTOR_SIZE, DESCRIPTOR_SYNC, Answer, Descriptor

MAX_SIZE = 256
"""Size of the longest answer of variable size that is accepted [bytes]."""


class AnswerSearch:
    """Searches received bytes for an answer; never raises, whatever the bytes.

    Parameters
    ----------
    sizes : accepted types of the answer, each with the size of its packet [bytes]; None for a variable size.
    multiple : the answer is a stream of packets; it is found with its descriptor.

    Attributes
    ----------
    descriptor : of the answer, None until it is found.
    payload : of the answer, empty for a stream.
    skipped : bytes before the answer so far.
    """

    def __init__(self, sizes: Mapping[Answer, int | None], *, multiple: bool = False) -> None:
        self._sizes = sizes
        self._multiple = multiple
        self._buffer = b""
        self.descriptor: Descriptor | None = None
        self.payload = b""
        self.skipped = b""

    def feed(self, data: bytes) -> bool:
        """Add bytes, and return whether the answer is found."""
        self._buffer += data
        while self.descriptor is None:
            start = self._buffer.find(DESCRIPTOR_SYNC)
            if start < 0:
                start = len(self._buffer) - self._buffer.endswith(DESCRIPTOR_SYNC[:1])
            self._skip(start)
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
        """Bytes after the answer: of a stream the first samples."""
        return self._buffer if self.descriptor is not None else b""

    def _expected(self, descriptor: Descriptor) -> bool:
        if descriptor.kind not in self._sizes or descriptor.multiple != self._multiple:
            return False
        size = self._sizes[Answer(descriptor.kind)]
        return descriptor.size <= MAX_SIZE if size is None else descriptor.size == size

    def _skip(self, count: int) -> None:
        self.skipped += self._buffer[:count]
        self._buffer = self._buffer[count:]
