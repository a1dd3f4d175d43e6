"""What a run reports of its progress, to whoever shows it."""

from types import TracebackType
from typing import Protocol, Self


class Progress(Protocol):
    """Tells a person how far a run is; a context manager."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    def update(self, share: float, count: int) -> None:
        """Show that ``share`` of all, 0 to 1, is done, and so many scans."""
        ...

    def solving(self) -> None:
        """Show that the source is done and the graph is being solved."""
        ...

    def say(self, line: str) -> None:
        """Print a line."""
        ...
