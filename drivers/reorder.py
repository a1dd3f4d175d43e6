"""Puts frames into the order of their stamps as they are read."""

import heapq
import math
from collections.abc import Iterator

from drivers.frame import Frame

REORDER_WINDOW = 60.0
"""Records may be out of order by this much [s]."""

REORDER_RECORDS = 10_000
"""No more records than this are held back for sorting, so that a clock that stands still does not fill the memory."""


class ReorderWindow:
    """Sorts frames by stamp, holding back those within the window of the newest one."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Frame]] = []
        self.yielded = -math.inf
        self.newest = -math.inf
        self.newest_line = 0

    def push(self, frame: Frame, line: int) -> Iterator[Frame]:
        """Take in the frame of a line; yield those that are certain to come before all that follow."""
        heapq.heappush(self._heap, (frame.stamp, line, frame))
        if frame.stamp > self.newest:
            self.newest, self.newest_line = frame.stamp, line
        while self._heap[0][0] < self.newest - REORDER_WINDOW or len(self._heap) > REORDER_RECORDS:
            yield self._pop()

    def flush(self) -> Iterator[Frame]:
        """Yield all that are held back."""
        while self._heap:
            yield self._pop()

    def _pop(self) -> Frame:
        self.yielded, _, frame = heapq.heappop(self._heap)
        return frame
