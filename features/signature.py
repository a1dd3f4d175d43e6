"""Signatures: what tells a corner from another one beside its position."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, wrap_angle


class Kind(IntEnum):
    """What a landmark is."""

    CONCAVE = 0
    """A corner that points away from the sensor, as the corners of a room do."""
    CONVEX = 1
    """A corner that points at the sensor, as the corners of a pillar do."""
    POINT = 2
    """A point that is no corner, such as a reflector; it has no angles."""


@dataclass(frozen=True, slots=True, eq=False)
class Signatures:
    """Kinds and angles of n corners or points.

    Parameters
    ----------
    kinds : a :class:`Kind` each, shape (n,).
    opening_angles : angles between the two walls, 0 to pi, shape (n,); NaN for a point [rad].
    orientations : directions of the bisectors, any number of turns, shape (n,); NaN for a point [rad].
    """

    kinds: NDArray[np.int64]
    opening_angles: Array
    orientations: Array

    @classmethod
    def of_points(cls, count: int) -> "Signatures":
        """Signatures of so many points."""
        unknown = np.full(count, np.nan)
        return cls(np.full(count, Kind.POINT, np.int64), unknown, unknown)

    @classmethod
    def concatenate(cls, parts: Sequence["Signatures"]) -> "Signatures":
        """Signatures of one or more parts, one part after the other."""
        return cls(
            np.concatenate([part.kinds for part in parts]),
            np.concatenate([part.opening_angles for part in parts]),
            np.concatenate([part.orientations for part in parts]),
        )

    def __len__(self) -> int:
        return len(self.kinds)

    def __getitem__(self, index: Any) -> "Signatures":
        """Signatures that a numpy index selects; ``[:, None]`` makes a column of them, as it does of an array."""
        return Signatures(self.kinds[index], self.opening_angles[index], self.orientations[index])

    def turned(self, angle: Array | float) -> "Signatures":
        """Signatures in a frame in which each corner is turned counter-clockwise by an angle [rad]."""
        return Signatures(self.kinds, self.opening_angles, self.orientations + angle)

    def faced(self, directions: Array, grazing: float) -> NDArray[np.bool_]:
        """Whether both walls of each corner are seen from a place, by more than a grazing angle.

        Parameters
        ----------
        directions : from each corner to the place, frame of the orientations, shape (n,) [rad].
        grazing : least angle between either wall and the line of sight [rad].

        Returns
        -------
        Shape (n,); True for a point, which has no walls.
        """
        away = wrap_angle(directions - self.orientations + np.where(self.kinds == Kind.CONVEX, np.pi, 0.0))
        return ~(np.abs(away) > 0.5 * self.opening_angles - grazing)


def alike(one: Signatures, other: Signatures, opening: float, orientation: float) -> NDArray[np.bool_]:
    """Whether two corners may be the same one: of one kind, and their angles differ little.

    Points have no angles, so that any two of them are alike; a point and a corner are not.

    Parameters
    ----------
    one, other : given in the same frame, of one shape or of shapes that numpy broadcasts.
    opening, orientation : the angles differ by less than this [rad].

    Returns
    -------
    Shape of the two, broadcast.
    """
    openings = np.abs(one.opening_angles - other.opening_angles)
    orientations = np.abs(wrap_angle(one.orientations - other.orientations))
    angles = (one.kinds == Kind.POINT) | ((openings < opening) & (orientations < orientation))
    return (one.kinds == other.kinds) & angles
