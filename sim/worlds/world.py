"""A world of straight walls, which may be the facets of curves, and the corners where they meet."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
import numpy.typing as npt

from features.se2 import Array, Pose
from sim.casting.raycast import WallIds, cast_beams, cast_scans
from sim.casting.wall_index import WallIndex
from sim.errors import WorldError
from sim.worlds.corners import TOUCH, find_corners


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Walls in the world frame, and their corners.

    Parameters
    ----------
    name : short name, fit for a folder.
    walls : end points ``x1 y1 x2 y2`` of each wall, shape (n, 4), n >= 1 [m].
    glass : whether each wall is of glass, shape (n,); by default none is.

    Attributes
    ----------
    corners : where exactly two walls end, not in one straight or curved line, and no third one passes, shape (k, 2)
        [m]; walls whose directions differ by less than :data:`sim.worlds.corners.BLUNT` are facets of a curve.
    opening_angles : angle between the two walls of each corner, in (0, pi - BLUNT), shape (k,) [rad].
    corner_walls : indices of the two walls of each corner, ascending, shape (k, 2).
    normals : unit normal of each wall, to the left of its direction, shape (n, 2).

    Raises
    ------
    WorldError
        There is no wall, a coordinate is not finite, a wall has no length, or there is not one flag for each wall.
    """

    name: str
    walls: Array
    glass: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    corners: Array = field(init=False)
    opening_angles: Array = field(init=False)
    corner_walls: npt.NDArray[np.int64] = field(init=False)
    normals: Array = field(init=False)
    _index: WallIndex = field(init=False, repr=False)
    _solid_index: WallIndex = field(init=False, repr=False)

    def __post_init__(self) -> None:
        walls = np.array(self.walls, dtype=np.float64, order="C")
        if walls.ndim != 2 or walls.shape[1] != 4 or len(walls) == 0:
            raise WorldError(f"world {self.name!r}: expected walls of shape (n, 4) with n >= 1, got {walls.shape}")
        for index, wall in enumerate(walls):
            if not np.isfinite(wall).all():
                raise WorldError(f"world {self.name!r}: wall {index} has a coordinate that is not finite: {wall}")
            if np.hypot(wall[2] - wall[0], wall[3] - wall[1]) <= TOUCH:
                raise WorldError(f"world {self.name!r}: wall {index} has no length: it starts and ends at {wall[:2]}")
        glass = np.array(self.glass, dtype=np.bool_) if len(self.glass) else np.zeros(len(walls), dtype=np.bool_)
        if glass.shape != (len(walls),):
            raise WorldError(f"world {self.name!r}: {len(walls)} walls, but flags of glass of shape {glass.shape}")
        index = WallIndex.of(walls)
        corners, opening_angles, corner_walls = find_corners(walls, index)
        object.__setattr__(self, "walls", walls)
        object.__setattr__(self, "glass", glass)
        object.__setattr__(self, "corners", corners)
        object.__setattr__(self, "opening_angles", opening_angles)
        object.__setattr__(self, "corner_walls", corner_walls)
        along = walls[:, 2:] - walls[:, :2]
        normals = along[:, ::-1] * [-1.0, 1.0] / np.hypot(*along.T)[:, None]
        object.__setattr__(self, "normals", normals)
        object.__setattr__(self, "_index", index)
        object.__setattr__(self, "_solid_index", WallIndex.of(walls, ~glass) if glass.any() else index)

    def cast(self, pose_world_sensor: Pose, angles: Array) -> tuple[Array, WallIds]:
        """Return the range to the nearest wall along each beam; :mod:`sim.casting.raycast` states what counts as a hit.

        Parameters
        ----------
        pose_world_sensor : shape (3,) [m, m, rad].
        angles : direction of each beam, in any order, sensor frame, shape (k,) [rad].

        Returns
        -------
        ranges : shape (k,) [m]; inf where no wall is hit.
        wall_ids : index of the wall that is hit, shape (k,); -1 where none is.

        Raises
        ------
        ValueError
            A shape is wrong, a value is not finite, or the direction of a beam is beyond 1e6 rad.
        """
        ranges, wall_ids = cast_scans(self._index, np.asarray(pose_world_sensor)[None], angles)
        return ranges[0], wall_ids[0]

    def cast_batch(self, poses_world_sensor: Array, angles: Array) -> tuple[Array, WallIds]:
        """Cast one scan from each of many poses, shape (m, 3) [m, m, rad]; as :meth:`cast`, with shapes (m, k)."""
        return cast_scans(self._index, poses_world_sensor, angles)

    def cast_beams(
        self, poses_world_sensor: Array, angles: Array, *, through_glass: bool = False
    ) -> tuple[Array, WallIds]:
        """Cast as :meth:`cast` does, but each beam from a pose of its own, shape (k, 3) [m, m, rad].

        With ``through_glass``, walls of glass are ignored.
        """
        return cast_beams(self._solid_index if through_glass else self._index, poses_world_sensor, angles)

    @classmethod
    def from_polygons(cls, name: str, polygons: Sequence[npt.ArrayLike]) -> Self:
        """Make a world of closed polygons.

        Parameters
        ----------
        name : short name, fit for a folder.
        polygons : vertices of each polygon in order, shape (n, 2), n >= 3 [m]; the last one is joined to the first.

        Raises
        ------
        WorldError
            There is no polygon, or one has fewer than three vertices, a coordinate that is not finite or a wall
            without length.
        """
        if len(polygons) == 0:
            raise WorldError(f"world {name!r}: expected at least one polygon, got none")
        return cls(name, np.vstack([_polygon_walls(name, k, polygon) for k, polygon in enumerate(polygons)]))


def _polygon_walls(name: str, index: int, polygon: npt.ArrayLike) -> Array:
    """Return the walls, shape (n, 4) [m], of a closed polygon of n vertices."""
    where = f"world {name!r}, polygon {index}"
    vertices = np.asarray(polygon, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[1] != 2:
        raise WorldError(f"{where}: expected vertices of shape (n, 2), got {vertices.shape}")
    if len(vertices) < 3:
        raise WorldError(f"{where}: expected at least 3 vertices, got {len(vertices)}")
    unusable = ~np.isfinite(vertices).all(axis=1)
    if unusable.any():
        vertex = int(unusable.argmax())
        raise WorldError(f"{where}: vertex {vertex} is {vertices[vertex]}: expected finite coordinates")
    ends = np.roll(vertices, -1, axis=0)
    empty = np.hypot(*(ends - vertices).T) <= TOUCH
    if empty.any():
        vertex = int(empty.argmax())
        raise WorldError(
            f"{where}: vertices {vertex} and {(vertex + 1) % len(vertices)} are the same point {vertices[vertex]}: "
            "each vertex is given once, the first one too"
        )
    return np.hstack([vertices, ends])
