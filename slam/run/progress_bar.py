"""Progress of a long run: a bar on a terminal, plain lines elsewhere."""

import time
from datetime import timedelta
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

BAR_EVERY_S, LINE_EVERY_S = 0.1, 10.0
"""Interval between updates of the bar, and between plain lines [s]."""


class ProgressBar:
    """Shows the share that is done, scans, scans/s and remaining time on stderr; a context manager.

    Parameters
    ----------
    title : of the bar.
    unit : what is counted.
    begun : share that was done before, 0 to 1.
    """

    def __init__(self, title: str, unit: str = "scans", begun: float = 0.0) -> None:
        self._title, self._unit, self._begun = title, unit, begun
        self._console = Console(stderr=True, soft_wrap=True, highlight=False)
        self._bar = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f}%"),
            TextColumn("{task.fields[figures]}"),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        )
        self._task = self._bar.add_task(title, total=1.0, figures="")
        self._bar.update(self._task, completed=begun)
        self._interval = BAR_EVERY_S if self._console.is_terminal else LINE_EVERY_S
        self._started = time.monotonic()
        self._due = self._started + self._interval

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()

    def update(self, share: float, count: int) -> None:
        """Show that ``share`` of all, 0 to 1, is done, and so many scans since the start."""
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + self._interval
        elapsed = now - self._started
        rate = count / elapsed if elapsed > 0.0 else 0.0
        figures = f"{count:,} {self._unit}, {rate:,.{0 if rate >= 10.0 else 1}f} {self._unit}/s"
        if share > self._begun:
            remaining = timedelta(seconds=round(elapsed * (1.0 - share) / (share - self._begun)))
            figures += f", {remaining} remaining"
        self._bar.update(self._task, completed=share, figures=figures)
        if not self._console.is_terminal:
            self.say(f"{self._title}: {share:.0%}, {figures}")

    def solving(self) -> None:
        """Show that the source is done and the graph is being solved."""
        self._bar.update(self._task, completed=1.0, figures="", description=f"{self._title}: solving the graph")
        self._bar.refresh()

    def say(self, line: str) -> None:
        """Print a line, above the bar where there is one."""
        self._console.print(line, markup=False)
