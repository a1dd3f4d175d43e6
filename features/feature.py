"""Lines and corners of one scan, singly and as arrays of records."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from features.sensor import Mounting
from features.signature import Kind, Signatures


class LineForm(IntEnum):
    """Parametrisation of a line: a regression gives one of the first two, any other fit the third."""

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
    kind : whether the corner is concave (of a room) or convex (of a pillar).
    """

    position: Array
    cov: Array
    opening_angle: float
    orientation: float
    kind: Kind

    @property
    def convex(self) -> bool:
        """Whether the corner points at the sensor, as those of a pillar do."""
        return self.kind == Kind.CONVEX


LINE_RECORD = np.dtype(
    [
        ("form", np.int64),
        ("params", np.float64, 2),
        ("center", np.float64),
        ("cov", np.float64, (2, 2)),
        ("ends", np.float64, (2, 2)),
        ("beams", np.int64, 2),
        ("count", np.int64),
    ]
)
"""Record of a line that the compiled kernels fill; :class:`Lines` gives its fields."""

CORNER_RECORD = np.dtype(
    [
        ("position", np.float64, 2),
        ("cov", np.float64, (2, 2)),
        ("opening_angle", np.float64),
        ("orientation", np.float64),
        ("kind", np.int64),
    ],
    align=True,
)
"""Record of a corner that the compiled kernels fill; :class:`Corners` gives its fields."""


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The L lines of a scan: indexing and iterating give a :class:`Line`, properties are views of the records.

    Parameters
    ----------
    records : one :data:`LINE_RECORD` each, shape (L,).
    """

    records: NDArray[np.void]

    @property
    def forms(self) -> NDArray[np.int64]:
        """A :class:`LineForm` each, shape (L,)."""
        return self.records["form"]

    @property
    def params(self) -> Array:
        """Parameters of each form, shape (L, 2), as in :class:`Line`."""
        return self.records["params"]

    @property
    def centers(self) -> Array:
        """Abscissae of the centroids, shape (L,) [m]."""
        return self.records["center"]

    @property
    def covs(self) -> Array:
        """Covariances of the parameters, shape (L, 2, 2)."""
        return self.records["cov"]

    @property
    def ends(self) -> Array:
        """Start and end, shape (L, 2, 2) [m]."""
        return self.records["ends"]

    @property
    def beams(self) -> NDArray[np.int64]:
        """Indices of the first and the last beam that were fitted, shape (L, 2).

        The first is larger than the last where a line crosses the end of the scan or the scan runs clockwise.
        """
        return self.records["beams"]

    @property
    def counts(self) -> NDArray[np.int64]:
        """Points of each line, shape (L,)."""
        return self.records["count"]

    def __len__(self) -> int:
        return self.records.size

    def __getitem__(self, index: int) -> Line:
        record = self.records[index]
        return Line(
            form=LineForm(record["form"]),
            params=record["params"],
            center=float(record["center"]),
            cov=record["cov"],
            start=record["ends"][0],
            end=record["ends"][1],
            count=int(record["count"]),
        )

    def __iter__(self) -> Iterator[Line]:
        return (self[index] for index in range(len(self)))


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """The K corners of a scan: indexing and iterating give a :class:`Corner`, properties are views of the records.

    Parameters
    ----------
    records : one :data:`CORNER_RECORD` each, shape (K,).
    """

    records: NDArray[np.void]

    @classmethod
    def of(cls, positions: Array, covs: Array, signatures: Signatures) -> "Corners":
        """Make corners of their positions, covariances and signatures."""
        records = np.empty(len(positions), CORNER_RECORD)
        records["position"] = positions
        records["cov"] = covs
        records["opening_angle"] = signatures.opening_angles
        records["orientation"] = signatures.orientations
        records["kind"] = signatures.kinds
        return cls(records)

    @property
    def positions(self) -> Array:
        """Shape (K, 2) [m]."""
        return self.records["position"]

    @property
    def covs(self) -> Array:
        """Shape (K, 2, 2) [m^2]."""
        return self.records["cov"]

    @property
    def opening_angles(self) -> Array:
        """Angles between the two walls, shape (K,), 0 to pi [rad]."""
        return self.records["opening_angle"]

    @property
    def orientations(self) -> Array:
        """Directions of the bisectors, shape (K,) [rad]."""
        return self.records["orientation"]

    @property
    def kinds(self) -> NDArray[np.int64]:
        """A :class:`features.signature.Kind` each, shape (K,)."""
        return self.records["kind"]

    @property
    def convex(self) -> NDArray[np.bool_]:
        """Whether each points at the sensor, shape (K,)."""
        return self.kinds == Kind.CONVEX

    @property
    def signatures(self) -> Signatures:
        """Kinds and angles of all, in the frame of the positions."""
        return Signatures(self.kinds, self.opening_angles, self.orientations)

    def __len__(self) -> int:
        return self.records.size

    def __getitem__(self, index: int) -> Corner:
        record = self.records[index]
        return Corner(
            position=record["position"],
            cov=record["cov"],
            opening_angle=float(record["opening_angle"]),
            orientation=float(record["orientation"]),
            kind=Kind(record["kind"]),
        )

    def __iter__(self) -> Iterator[Corner]:
        return (self[index] for index in range(len(self)))

    def to_robot(self, mounting: Mounting) -> "Corners":
        """Corners, given in the sensor frame, in the robot frame."""
        if not len(self):
            return self
        axes = mounting.axes
        bisectors = np.stack([np.cos(self.orientations), np.sin(self.orientations)], axis=-1) @ axes.T
        records = self.records.copy()
        records["position"] = mounting.points_to_robot(self.positions)
        records["cov"] = axes @ self.covs @ axes.T
        records["orientation"] = np.arctan2(bisectors[:, 1], bisectors[:, 0])
        return Corners(records)


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Lines of one scan, and the corners where neighbouring lines meet, sensor frame."""

    lines: Lines
    corners: Corners
