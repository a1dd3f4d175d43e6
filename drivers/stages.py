"""What a source of frames may pass through on its way: wheels join it, a clock paces it."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from drivers.frame import Frame, FrameSource
from features.se2 import Pose
from features.sensor import Mounting


class PoseAtStamp(Protocol):
    """Tells an odometry pose, shape (3,), at a stamp [s]."""

    def at(self, stamp: float) -> Pose:
        """Pose at a stamp."""
        ...


@dataclass(frozen=True, slots=True)
class Stage:
    """A source that passes on what another one yields, as it is."""

    source: FrameSource

    @property
    def name(self) -> str:
        """Name of the source."""
        return self.source.name

    @property
    def sensor(self) -> str:
        """Sensor preset of the source."""
        return self.source.sensor

    @property
    def mounting(self) -> Mounting:
        """Mounting of the source's sensor."""
        return self.source.mounting

    @property
    def has_odometry(self) -> bool:
        """Whether the poses of the frames tell the motion."""
        return self.source.has_odometry

    @property
    def progress(self) -> float:
        """Share of the source that has been read, 0 to 1."""
        return self.source.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames of the source."""
        yield from self.source


@dataclass(frozen=True, slots=True)
class WithOdometry(Stage):
    """Frames with the odometry poses of another instrument, which tells them at any stamp."""

    odometry: PoseAtStamp

    @property
    def has_odometry(self) -> bool:
        """Whether the poses of the frames tell the motion: they do."""
        return True

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames, each with its pose."""
        for frame in self.source:
            yield replace(frame, pose_odom_robot=self.odometry.at(frame.stamp))


@dataclass(frozen=True, slots=True)
class Paced(Stage):
    """Frames in time with the clock, ``speed`` times as fast as they were taken."""

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
