"""Progress of a long run: a bar on a terminal, plain lines elsewhere."""

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

LINE_EVERY_S = 10.0
"""Interval between plain lines [s]."""


class _ScanRateColumn(ProgressColumn):
    def render(self, task: Task) -> Text:
        scans, elapsed = task.fields["scans"], task.elapsed or 0.0
        rate = f"{scans / elapsed:,.0f}" if elapsed > 0.0 else "-"
        return Text(f"{scans:,} scans, {rate} scans/s")


class RunProgress:
    """Shows the share of a source that is done, scans, scans/s and remaining time on stderr; a context manager."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._console = Console(stderr=True, soft_wrap=True, highlight=False)
        self._bar = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f}%"),
            _ScanRateColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=1.0, scans=0)
        self._started = self._last_line = time.monotonic()

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def update(self, share: float, scans: int) -> None:
        """Show that ``share`` of the source, 0 to 1, and so many scans are done."""
        self._bar.update(self._task, completed=share, scans=scans)
        now = time.monotonic()
        if self._console.is_terminal or now - self._last_line < LINE_EVERY_S:
            return
        self._last_line = now
        elapsed = now - self._started
        remaining = f", {elapsed * (1.0 - share) / share:.0f} s remaining" if share > 0.0 else ""
        self.say(f"{self._title}: {share:.0%}, {scans} scans, {scans / elapsed:.0f} scans/s{remaining}")

    def solving(self, scans: int) -> None:
        """Show that the source is done and the graph is being solved."""
        self._bar.update(self._task, completed=1.0, scans=scans, description=f"{self._title}: solving the graph")
        self._bar.refresh()

    def say(self, line: str) -> None:
        """Print a line, above the bar where there is one."""
        self._console.print(line, markup=False)
