"""State of a live run: rate, drops, landmarks, pose and how far behind it is; in place on a terminal, else lines."""

import math
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

from drivers.counts import Counts
from slam.pipeline import Slam

REFRESH_S = 0.25
LINE_EVERY_S = 10.0
"""Intervals at which a terminal is refreshed, and between plain lines [s]."""

WINDOW = 30
"""Scans over which the rate is averaged."""


class LiveProgress:
    """State of a live run on stderr; a context manager.

    Parameters
    ----------
    title : what is run.
    slam : that takes the scans; None where they are only recorded.
    counts : returns what became of the scanner's bytes; None where nothing is counted.
    now : the clock of the stamps [s]; None where they are not of today.
    """

    def __init__(
        self,
        title: str,
        slam: Slam | None = None,
        counts: Callable[[], Counts] | None = None,
        now: Callable[[], float] | None = None,
    ) -> None:
        self._title, self._slam, self._counts, self._now = title, slam, counts, now
        self._console = Console(stderr=True, soft_wrap=True, highlight=False)
        self._live = Live(console=self._console, auto_refresh=False, transient=True)
        self._shown = time.monotonic()
        self._times: deque[float] = deque(maxlen=WINDOW)
        self._busy = time.process_time(), self._shown
        self._load = 0.0

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def update(self, share: float, count: int) -> None:
        """Show that so many scans are done, and ``share`` of all, 0 where it is unknown."""
        now = time.monotonic()
        self._times.append(now)
        terminal = self._console.is_terminal
        if now - self._shown < (REFRESH_S if terminal else LINE_EVERY_S):
            return
        self._shown = now
        self._measure_load(now)
        rows = self._rows(share, count)
        if terminal:
            table = Table.grid(padding=(0, 2))
            for name, value in rows:
                table.add_row(name, value)
            self._live.update(table, refresh=True)
        else:
            self.say(", ".join(f"{name} {value}" for name, value in rows))

    def solving(self) -> None:
        """Show that the source is done and the graph is being solved."""
        self._live.stop()

    def say(self, line: str) -> None:
        """Print a line, above the rest where there is one."""
        self._console.print(line, markup=False)

    def _measure_load(self, now: float) -> None:
        """Measure the share of a core that this process has used, over a second or more."""
        used = time.process_time()
        if now - self._busy[1] > 1.0:
            self._load = (used - self._busy[0]) / (now - self._busy[1])
            self._busy = used, now

    def _rows(self, share: float, count: int) -> list[tuple[str, str]]:
        elapsed = self._times[-1] - self._times[0]
        rate = (len(self._times) - 1) / elapsed if elapsed > 0.0 else 0.0
        done = f", {share:.0%} of the recording" if share else ""
        rows = [(self._title, f"{count:,} scans{done}, {rate:.1f} scans/s, {self._load:.0%} of a core")]
        if self._slam is not None and self._now is not None:
            rows[0] = self._title, f"{rows[0][1]}, {self._now() - self._slam.stamp:.2f} s behind"
        if self._counts is not None:
            counts = self._counts()
            rows.append(
                (
                    "lost",
                    f"{counts.dropped_revolutions} revolutions dropped, {counts.broken_revolutions} broken, "
                    f"{counts.patchy_revolutions} patchy, {counts.checksum_errors} checksum errors, "
                    f"{counts.dropped_bytes} bytes, {counts.reconnects} reconnects",
                )
            )
        if self._slam is not None:
            x, y, theta = self._slam.pose
            rows.append(("pose", f"{x:.2f} m, {y:.2f} m, {math.degrees(theta):.0f} deg"))
            rows.append(("landmarks", f"{len(self._slam.landmarks)} near"))
        return rows
