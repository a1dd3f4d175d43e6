"""Graphs of odometry and landmark observations in text, such as the Victoria Park data set that comes with GTSAM."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drivers.data_sets.number_table import finite_numbers, table_rows
from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, LandmarkObservations, SourceInfo
from features.se2 import Array, Pose, compose, pose

ODOMETRY = "ODOMETRY from to x y theta cov_xx cov_xy cov_xt cov_yy cov_yt cov_tt"
LANDMARK = "LANDMARK from to x y cov_xx cov_xy cov_yy"


@dataclass(frozen=True, slots=True)
class _Vertex:
    """A pose, and the landmarks seen from it: identity, position [m] and covariance [m^2], in the robot frame."""

    number: int
    pose_odom_robot: Pose
    seen: list[tuple[int, Array, Array]] = field(default_factory=list[tuple[int, Array, Array]])


class VictoriaPark(FrameSource):
    """A chain of `ODOMETRY` edges, and the `LANDMARK` edges from its poses, each with its landmark's identity.

    There is a frame for each pose. The file has no times: the stamp of a pose is its number.

    Parameters
    ----------
    path : the file, plain or gzipped.

    Raises
    ------
    LogFormatError
        The file cannot be read, or a line is unusable.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = Path(path)
        self._read = 0
        self._vertices = self._parse()

    @property
    def info(self) -> SourceInfo:
        """Name of the file up to its first dot; the scanner of the data set, from whose pose the landmarks are seen."""
        return SourceInfo(self._path.name.split(".")[0], "sick-lms")

    @property
    def progress(self) -> float:
        """Share of the poses that has been read, 0 to 1."""
        return self._read / len(self._vertices)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of the file; each call starts at the first."""
        for k, vertex in enumerate(self._vertices):
            self._read = k + 1
            yield Frame(float(k), vertex.pose_odom_robot, observations=_polar(vertex) if vertex.seen else None)

    def _parse(self) -> list[_Vertex]:
        vertices: list[_Vertex] = []
        for number, (kind, *fields) in table_rows(self._path, "ODOMETRY or LANDMARK edges"):
            columns = {b"ODOMETRY": ODOMETRY, b"LANDMARK": LANDMARK}.get(kind)
            where = f"{self._path}, line {number}"
            if columns is None:
                raise LogFormatError(f"{where}: {kind[:40].decode(errors='replace')!r}: expected ODOMETRY or LANDMARK")
            if len(fields) + 1 != len(columns.split()):
                raise LogFormatError(f"{where}: {len(fields) + 1} fields: expected `{columns}`")
            start, end, *values = finite_numbers(self._path, number, fields, columns)
            if not vertices:
                vertices.append(_Vertex(int(start), pose()))
            newest = vertices[-1]
            if start != newest.number:
                raise LogFormatError(
                    f"{where}: the edge is from pose {start:g}: expected one from the newest, {newest.number}"
                )
            if columns is ODOMETRY:
                x, y, theta = values[:3]
                vertices.append(_Vertex(int(end), compose(newest.pose_odom_robot, pose(x, y, theta))))
                continue
            xx, xy, yy = values[2:]
            if not (xx > 0.0 and xx * yy - xy * xy > 0.0):
                raise LogFormatError(f"{where}: the covariance is not positive definite: expected `{columns}`")
            if end < 0 or not (values[0] or values[1]):
                raise LogFormatError(f"{where}: a landmark below 0, or where the robot is: expected `{columns}`")
            newest.seen.append((int(end), np.array(values[:2]), np.array([[xx, xy], [xy, yy]])))
        if not vertices:
            raise LogFormatError(f"{self._path} is empty: expected ODOMETRY and LANDMARK edges")
        return vertices


def is_edge_list(start: bytes) -> bool:
    """Whether a text begins with an edge."""
    return start.startswith((b"ODOMETRY ", b"LANDMARK "))


def _polar(vertex: _Vertex) -> LandmarkObservations:
    identities, positions, covs = zip(*vertex.seen, strict=True)
    x, y = np.array(positions).T
    ranges = np.hypot(x, y)
    by_position = np.array([[x / ranges, y / ranges], [-y / ranges**2, x / ranges**2]]).transpose(2, 0, 1)
    return LandmarkObservations(
        ranges, np.arctan2(y, x), by_position @ np.array(covs) @ by_position.transpose(0, 2, 1), np.array(identities)
    )
