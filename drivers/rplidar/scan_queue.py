"""Hands revolutions from the thread that reads to the one that takes them."""

from collections import deque
from threading import Condition

from features.scan import LaserScan


class ScanQueue:
    """The last revolutions that were not taken; where it is full, the oldest makes room.

    Parameters
    ----------
    capacity : revolutions that it holds, 1 or more.

    Attributes
    ----------
    dropped : revolutions that nobody took in time.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"capacity is {capacity}: expected 1 or more")
        self.dropped = 0
        self._scans: deque[LaserScan] = deque(maxlen=capacity)
        self._changed = Condition()
        self._ended = False
        self._failure: BaseException | None = None

    def put(self, scan: LaserScan) -> None:
        """Add a revolution."""
        with self._changed:
            self.dropped += len(self._scans) == self._scans.maxlen
            self._scans.append(scan)
            self._changed.notify()

    def end(self, failure: BaseException | None = None) -> None:
        """Say that no more will come; who takes gets what is left, then the failure."""
        with self._changed:
            self._ended, self._failure = True, failure or self._failure
            self._changed.notify_all()

    def take(self, timeout: float | None) -> LaserScan | None:
        """Oldest revolution; None where none comes in time [s], or none will come any more."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans or self._ended, timeout)
            if self._scans:
                return self._scans.popleft()
            if self._failure is not None:
                raise self._failure
            return None

    @property
    def ended(self) -> bool:
        """Whether nothing is left and no more will come."""
        with self._changed:
            return self._ended and not self._scans
