"""Frames, and the sources that yield them."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from features.scan import LaserScan
from features.se2 import Array, Pose
from features.sensor import Mounting


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkObservations:
    """Landmarks that a sensor has found by itself, sensor frame.

    Parameters
    ----------
    ranges : shape (k,), positive [m].
    bearings : counter-clockwise, shape (k,) [rad].
    covs : of range and bearing, shape (k, 2, 2) [m^2, m rad, rad^2]; None where they are those of the sensor's model.
    identities : which landmark each is, shape (k,), 0 or more; None where that is not known.

    Raises
    ------
    ValueError
        Shapes do not fit, a value is not finite, a range is not positive, a covariance is not positive definite or an
        identity is negative.
    """

    ranges: Array
    bearings: Array
    covs: Array | None = None
    identities: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        ranges, bearings = np.asarray(self.ranges, np.float64), np.asarray(self.bearings, np.float64)
        if ranges.ndim != 1 or bearings.shape != ranges.shape:
            raise ValueError(f"ranges {ranges.shape} and bearings {bearings.shape}: expected one shape (k,)")
        if not (np.isfinite(ranges).all() and np.isfinite(bearings).all() and (ranges > 0.0).all()):
            raise ValueError("a range or bearing is not finite, or a range is not positive")
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "bearings", bearings)
        if self.covs is not None:
            covs = np.asarray(self.covs, np.float64)
            if covs.shape != (ranges.size, 2, 2):
                raise ValueError(f"covariances of shape {covs.shape}: expected {(ranges.size, 2, 2)}")
            with np.errstate(over="ignore"):
                definite = (covs[:, 0, 0] > 0.0) & (np.linalg.det(covs) > 0.0)
            if not (np.isfinite(covs).all() and definite.all()):
                raise ValueError("a covariance of an observation is not positive definite")
            object.__setattr__(self, "covs", covs)
        if self.identities is not None:
            identities = np.asarray(self.identities, np.int64)
            if identities.shape != ranges.shape or (identities < 0).any():
                raise ValueError(f"identities of shape {identities.shape}: expected {ranges.shape}, none negative")
            object.__setattr__(self, "identities", identities)

    def __len__(self) -> int:
        return self.ranges.size


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The odometry pose at a stamp and, where the record has one, what the sensor saw there.

    Parameters
    ----------
    stamp : time of the record [s].
    pose_odom_robot : odometry pose, shape (3,) [m, m, rad]; the origin where the source has no odometry.
    scan : sensor frame; None for a record of odometry only.
    observations : of landmarks, by a sensor that finds them itself, instead of a scan.

    Raises
    ------
    ValueError
        There are both a scan and observations.
    """

    stamp: float
    pose_odom_robot: Pose
    scan: LaserScan | None = None
    observations: LandmarkObservations | None = None

    def __post_init__(self) -> None:
        if self.scan is not None and self.observations is not None:
            raise ValueError("a frame has a scan or observations, not both")


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What a source of frames knows of itself before its first frame.

    Parameters
    ----------
    name : short name, fit for a folder.
    sensor : name of the sensor preset that fits the source unless the user chooses another one.
    mounting : where the sensor sits on the robot; the robot's origin where the source does not know.
    has_odometry : whether the poses of the frames follow the robot's motion; without odometry they are all the origin.
    """

    name: str
    sensor: str
    mounting: Mounting = Mounting()  # noqa: RUF009, frozen
    has_odometry: bool = True


class FrameSource(Protocol):
    """Frames in the order of their stamps, and what the source knows of itself.

    Classes that inherit from it give ``info``, ``progress`` and the iteration; the four values of ``info`` are then
    properties of the source too. Iterating may raise :class:`features.errors.CwlfError`; the frames yielded before stay
    valid.
    """

    @property
    @abstractmethod
    def info(self) -> SourceInfo:
        """Name, sensor, mounting and odometry of the source; known before the first frame."""
        ...

    @property
    @abstractmethod
    def progress(self) -> float:
        """Share of the source that has been read, 0 to 1; 0 for a source without an end."""
        ...

    @abstractmethod
    def __iter__(self) -> Iterator[Frame]: ...

    @property
    def name(self) -> str:
        """Short name, fit for a folder."""
        return self.info.name

    @property
    def sensor(self) -> str:
        """Name of the sensor preset that fits the source unless the user chooses another one."""
        return self.info.sensor

    @property
    def mounting(self) -> Mounting:
        """Where the sensor sits on the robot."""
        return self.info.mounting

    @property
    def has_odometry(self) -> bool:
        """Whether the poses of the frames follow the robot's motion."""
        return self.info.has_odometry
