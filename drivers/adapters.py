"""Adapters between a source of frames and its consumer: odometry from another instrument, playback in real time."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from drivers.frame import Frame, FrameSource, SourceInfo
from features.se2 import Pose


class PoseAtStamp(Protocol):
    """Odometry that is known at any time."""

    def at(self, stamp: float) -> Pose:
        """Odometry pose at a stamp [s], shape (3,) [m, m, rad]."""
        ...


@dataclass(frozen=True, slots=True)
class SourceAdapter(FrameSource):
    """A source that yields the frames of another one unchanged; subclasses change them.

    Parameters
    ----------
    source : of the frames.
    """

    source: FrameSource

    @property
    def info(self) -> SourceInfo:
        """That of the source."""
        return self.source.info

    @property
    def progress(self) -> float:
        """Share of the source that has been read, 0 to 1."""
        return self.source.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames of the source."""
        yield from self.source


@dataclass(frozen=True, slots=True)
class WithOdometry(SourceAdapter):
    """Frames of a source with the odometry poses of another instrument.

    Parameters
    ----------
    source : of the frames.
    odometry : gives the pose at the stamp of each frame.
    """

    odometry: PoseAtStamp

    @property
    def info(self) -> SourceInfo:
        """That of the source, with odometry."""
        return replace(self.source.info, has_odometry=True)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, each with its odometry pose."""
        for frame in self.source:
            yield replace(frame, pose_odom_robot=self.odometry.at(frame.stamp))


@dataclass(frozen=True, slots=True)
class Paced(SourceAdapter):
    """Frames of a recorded source at the intervals of their stamps, as a live source would yield them.

    Parameters
    ----------
    source : of the frames.
    speed : how many times faster than they were recorded, positive.
    clock : returns the time [s].
    sleep : waits for a duration [s].
    """

    speed: float
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, none before its time."""
        start: tuple[float, float] | None = None
        for frame in self.source:
            if start is None:
                start = self.clock(), frame.stamp
            due = start[0] + (frame.stamp - start[1]) / self.speed
            if (wait := due - self.clock()) > 0.0:
                self.sleep(wait)
            yield frame
