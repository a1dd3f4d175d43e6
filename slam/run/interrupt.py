"""Ctrl-C as a request to come to an end, not as an exception in the middle of a computation."""

import signal
from collections.abc import Callable, Iterable, Iterator
from types import FrameType, TracebackType
from typing import Any, Self, TypeVar

Item = TypeVar("Item")


class Interrupt:
    """Inside the context the first SIGINT or SIGTERM sets ``requested``; a second one interrupts as usual."""

    def __init__(self) -> None:
        self.requested = False
        self._waiting = False
        self._handlers: dict[signal.Signals, Callable[[int, FrameType | None], Any] | int | None] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGINT, signal.SIGTERM):
            self._handlers[number] = signal.signal(number, self._request)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def until(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield items until a signal comes, also while the next one is waited for, however long that takes."""
        waited = iter(items)
        while not self.requested:
            try:
                self._waiting = True
                item = next(waited)
                self._waiting = False
            except StopIteration:
                return
            except KeyboardInterrupt:
                if not self.requested:
                    raise
                return
            finally:
                self._waiting = False
            yield item

    def _request(self, number: int, frame: FrameType | None) -> None:
        if self.requested or self._waiting:
            self.requested = True
            self._waiting = False
            raise KeyboardInterrupt
        self.requested = True
