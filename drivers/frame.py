"""What every source of data yields, and what a source is."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from features.scan import LaserScan
from features.se2 import Pose
from features.sensor import Mounting


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The odometry pose at a stamp and, where the record has one, the scan taken there.

    Parameters
    ----------
    stamp : time of the record [s].
    pose_odom_robot : odometry pose, shape (3,) [m, m, rad]; the origin where the source has no odometry.
    scan : sensor frame; None for a record of odometry only.
    """

    stamp: float
    pose_odom_robot: Pose
    scan: LaserScan | None = None


class FrameSource(Protocol):
    """Frames in the order of their stamps, and what the source itself knows of its sensor.

    Iterating may raise :class:`features.errors.CwlfError`; the frames yielded before stay valid.
    """

    @property
    def name(self) -> str:
        """Short name, fit for a folder."""
        ...

    @property
    def sensor(self) -> str:
        """Name of the sensor preset that fits this source unless the user says otherwise."""
        ...

    @property
    def mounting(self) -> Mounting:
        """Where the sensor sits on the robot, as far as the source says so; known before the first frame."""
        ...

    @property
    def has_odometry(self) -> bool:
        """Whether the poses of the frames tell the motion; without odometry they are all the origin."""
        ...

    @property
    def progress(self) -> float:
        """Share of the source that has been read, 0 to 1."""
        ...

    def __iter__(self) -> Iterator[Frame]: ...
