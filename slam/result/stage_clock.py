"""Time and memory that a run takes."""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from slam.result.run_metrics import StageTime


class StageClock:
    """Times of the stages of a run, call by call; pickled, the clock stops until it is read back.

    Parameters
    ----------
    stages : their names.
    """

    def __init__(self, *stages: str) -> None:
        self._seconds: dict[str, list[float]] = {stage: [] for stage in stages}
        self._started = time.perf_counter()

    def __getstate__(self) -> dict[str, Any]:
        return {"_seconds": self._seconds, "_started": self.elapsed}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._seconds = state["_seconds"]
        self._started = time.perf_counter() - state["_started"]

    @property
    def elapsed(self) -> float:
        """Time since the clock was made [s]."""
        return time.perf_counter() - self._started

    @contextmanager
    def timed(self, stage: str) -> Generator[None]:
        """Count the time inside the context as one call of a stage."""
        start = time.perf_counter()
        yield
        self._seconds[stage].append(time.perf_counter() - start)

    def stages(self) -> dict[str, StageTime]:
        """Summary of each stage."""
        return {stage: StageTime.of(seconds) for stage, seconds in self._seconds.items()}


def peak_memory_mb() -> float | None:
    """Largest resident memory of this process so far [MB]; None where the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)
