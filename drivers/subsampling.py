"""Subsampling of a source: without its beginning, and with fewer scans."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.adapters import SourceAdapter
from drivers.errors import LogFormatError
from drivers.frame import Frame


@dataclass(frozen=True, slots=True)
class Subsampled(SourceAdapter):
    """The frames of a source after a start time, every n-th with its scan or observations.

    All frames keep their odometry pose, so that the result is that of a sensor slower than the wheels.

    Parameters
    ----------
    source : of the frames.
    every : n: the first scan is kept, and every n-th after it; 1 or more.
    skip : duration from the first frame on whose frames are left out [s].

    Raises
    ------
    ValueError
        ``every`` is below 1, or ``skip`` negative or not finite.
    """

    every: int = 1
    skip: float = 0.0

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ValueError(f"every {self.every}th scan: expected 1 or more")
        if not (math.isfinite(self.skip) and self.skip >= 0.0):
            raise ValueError(f"skip is {self.skip:g} s: expected 0 or more")

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of their stamps; each call starts at the first.

        Raises
        ------
        LogFormatError
            The source has no scan after ``skip``.
        """
        start: float | None = None
        measured = 0
        for frame in self.source:
            start = frame.stamp if start is None else start
            if frame.stamp - start < self.skip:
                continue
            if frame.scan is not None or frame.observations is not None:
                measured += 1
                if (measured - 1) % self.every:
                    yield replace(frame, scan=None, observations=None)
                    continue
            yield frame
        if start is not None and not measured:
            raise LogFormatError(f"{self.name} has no scan after its first {self.skip:g} s: skip less of it")
