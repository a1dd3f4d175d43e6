"""Sorts frames by their stamps while they are read."""

import heapq
import math
from collections.abc import Iterator

from drivers.frame import Frame

REORDER_WINDOW = 60.0
"""Largest time by which records may be out of order [s]."""

REORDER_RECORDS = 10_000
"""Largest number of records in the window, which bounds the memory where stamps do not advance."""


class ReorderWindow:
    """Sorts frames by stamp; frames within :data:`REORDER_WINDOW` of the newest one wait in it."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Frame]] = []
        self.yielded = -math.inf
        self.newest = -math.inf
        self.newest_line = 0

    def push(self, frame: Frame, line: int) -> Iterator[Frame]:
        """Add the frame of a line; yield the frames that are older than the window."""
        heapq.heappush(self._heap, (frame.stamp, line, frame))
        if frame.stamp > self.newest:
            self.newest, self.newest_line = frame.stamp, line
        while self._heap[0][0] < self.newest - REORDER_WINDOW or len(self._heap) > REORDER_RECORDS:
            yield self._pop()

    def flush(self) -> Iterator[Frame]:
        """Yield all frames that wait."""
        while self._heap:
            yield self._pop()

    def _pop(self) -> Frame:
        self.yielded, _, frame = heapq.heappop(self._heap)
        return frame
