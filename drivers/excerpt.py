"""Part of a source: without its beginning, and with fewer scans."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.errors import LogFormatError
from drivers.frame import Frame
from drivers.stages import Stage


@dataclass(frozen=True, slots=True)
class Excerpt(Stage):
    """The frames of a source after a time, only some of them with their scan.

    Every record keeps its odometry pose, as that of a sensor that is slower than the wheels.

    Parameters
    ----------
    source : of the frames.
    every : one scan of so many is kept, the first one first, 1 or more; so are ready-made observations of a record.
    skip : time from the first frame up to which all are left out [s].

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
            The source ends before the time from which on it was wanted.
        """
        start: float | None = None
        looks = 0
        for frame in self.source:
            start = frame.stamp if start is None else start
            if frame.stamp - start < self.skip:
                continue
            if frame.scan is not None or frame.observations is not None:
                looks += 1
                if (looks - 1) % self.every:
                    yield replace(frame, scan=None, observations=None)
                    continue
            yield frame
        if start is not None and not looks:
            raise LogFormatError(f"{self.name} has no scan after its first {self.skip:g} s: skip less of it")
