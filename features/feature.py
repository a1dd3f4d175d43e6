"""Lines and corners of one scan, each kind as one value of parallel arrays."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from features.sensor import Mounting


class LineForm(IntEnum):
    """How a line is parametrised; what a fit gives depends on its method and, for a regression, on the axis."""

    Y_ON_X = 0
    """``y = m (x - center) + b``, eq. 28; parameters m, b [m]."""
    X_ON_Y = 1
    """``x = s (y - center) + h``, eq. 35; parameters s, h [m]."""
    POLAR = 2
    """``x cos(alpha) + y sin(alpha) = r``, eq. 16-17; parameters alpha [rad], r [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A straight wall section, sensor frame.

    Parameters
    ----------
    form : what the parameters are.
    params : (m, b), (s, h) or (alpha, r), shape (2,).
    center : abscissa of the centroid that b or h belong to [m]; 0 for a polar line.
    cov : covariance of the parameters, shape (2, 2).
    start, end : the first and the last point of the segment projected onto the line, shape (2,) [m].
    count : number of points that were fitted.
    """

    form: LineForm
    params: Array
    center: float
    cov: Array
    start: Array
    end: Array
    count: int


@dataclass(frozen=True, slots=True, eq=False)
class Corner:
    """Intersection of two neighbouring lines.

    Parameters
    ----------
    position : shape (2,) [m].
    cov : shape (2, 2) [m^2].
    opening_angle : angle between the two walls, 0 to pi [rad].
    orientation : direction of the bisector from the corner into the angle between the walls [rad].
    convex : True where the corner points at the sensor (a pillar), False where it points away (a room).
    """

    position: Array
    cov: Array
    opening_angle: float
    orientation: float
    convex: bool


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The L lines of a scan; indexing and iterating give :class:`Line`.

    Parameters
    ----------
    forms : a :class:`LineForm` each, shape (L,).
    params : of each form, shape (L, 2), as in :class:`Line`.
    centers : shape (L,) [m].
    covs : of the parameters, shape (L, 2, 2).
    ends : start and end, shape (L, 2, 2) [m].
    beams : indices of the first and the last beam that were fitted, shape (L, 2); the first is larger than the last
        where a line crosses the end of the scan or the scan runs clockwise.
    counts : points of each line, shape (L,).
    """

    forms: NDArray[np.int64]
    params: Array
    centers: Array
    covs: Array
    ends: Array
    beams: NDArray[np.int64]
    counts: NDArray[np.int64]

    def __len__(self) -> int:
        return self.counts.size

    def __getitem__(self, index: int) -> Line:
        return Line(
            form=LineForm(self.forms[index]),
            params=self.params[index],
            center=float(self.centers[index]),
            cov=self.covs[index],
            start=self.ends[index, 0],
            end=self.ends[index, 1],
            count=int(self.counts[index]),
        )

    def __iter__(self) -> Iterator[Line]:
        return (self[index] for index in range(len(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """The K corners of a scan; indexing and iterating give :class:`Corner`.

    Parameters
    ----------
    positions : shape (K, 2) [m].
    covs : shape (K, 2, 2) [m^2].
    opening_angles : shape (K,) [rad].
    orientations : shape (K,) [rad].
    convex : shape (K,), bool.
    """

    positions: Array
    covs: Array
    opening_angles: Array
    orientations: Array
    convex: NDArray[np.bool_]

    def __len__(self) -> int:
        return self.convex.size

    def __getitem__(self, index: int) -> Corner:
        return Corner(
            position=self.positions[index],
            cov=self.covs[index],
            opening_angle=float(self.opening_angles[index]),
            orientation=float(self.orientations[index]),
            convex=bool(self.convex[index]),
        )

    def __iter__(self) -> Iterator[Corner]:
        return (self[index] for index in range(len(self)))

    def to_robot(self, mounting: Mounting) -> "Corners":
        """Turn corners of the sensor frame into corners of the robot frame."""
        axes = mounting.axes
        bisectors = np.stack([np.cos(self.orientations), np.sin(self.orientations)], axis=-1) @ axes.T
        return Corners(
            positions=mounting.points_to_robot(self.positions),
            covs=axes @ self.covs @ axes.T,
            opening_angles=self.opening_angles,
            orientations=np.arctan2(bisectors[:, 1], bisectors[:, 0]),
            convex=self.convex,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """What one scan shows: its lines, and the corners where neighbouring lines meet, sensor frame."""

    lines: Lines
    corners: Corners
