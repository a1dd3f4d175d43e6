"""A queue of revolutions between the reading thread and the consumer."""

from collections import deque
from threading import Condition

from features.scan import LaserScan


class ScanQueue:
    """A queue of bounded size that drops the oldest revolution when it is full.

    Parameters
    ----------
    capacity : largest number of revolutions, 1 or more.

    Attributes
    ----------
    dropped : number of revolutions that were dropped.
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
        """Mark the end: after the remaining revolutions, ``take`` raises the failure or returns None."""
        with self._changed:
            self._ended, self._failure = True, failure or self._failure
            self._changed.notify_all()

    def take(self, timeout: float | None) -> LaserScan | None:
        """Take the oldest revolution; None after a timeout [s], or at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._scans or self._ended, timeout)
            if self._scans:
                return self._scans.popleft()
            if self._failure is not None:
                raise self._failure
            return None

    @property
    def ended(self) -> bool:
        """Whether the end was marked and all revolutions were taken."""
        with self._changed:
            return self._ended and not self._scans
