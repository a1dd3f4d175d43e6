"""People who walk through the scans of a lidar: discs that move."""

import math
from dataclasses import dataclass

import numpy as np

from features.se2 import Array


@dataclass(frozen=True, slots=True, eq=False)
class Person:
    """A disc that goes along a path and back, again and again, at constant speed.

    Parameters
    ----------
    path : points of its path, shape (n, 2), n >= 1, world frame [m]; it is at the first one at time zero. With one
        point it stands still.
    speed : walking speed [m/s].
    radius : radius of the disc [m].

    Raises
    ------
    ValueError
        The path has another shape or is not finite, the speed is negative or the radius not positive.
    """

    path: Array
    speed: float = 1.0
    radius: float = 0.25

    def __post_init__(self) -> None:
        path = np.array(self.path, dtype=np.float64)
        if path.ndim != 2 or path.shape[1] != 2 or len(path) == 0 or not np.isfinite(path).all():
            raise ValueError(f"path of a person has shape {path.shape}: expected finite points of shape (n, 2), n >= 1")
        if not (math.isfinite(self.speed) and self.speed >= 0.0):
            raise ValueError(f"speed is {self.speed:g}: expected metres per second, not negative")
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"radius is {self.radius:g}: expected a positive number of metres")
        object.__setattr__(self, "path", path)

    def at(self, times: Array) -> Array:
        """Return the centres of the person, shape (n, 2), world frame [m], at times of shape (n,) [s]."""
        steps = np.diff(self.path, axis=0)
        walked = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
        length = walked[-1]
        if length == 0.0:
            return np.broadcast_to(self.path[0], (len(times), 2))
        distances: Array = length - abs(self.speed * times % (2.0 * length) - length)
        return np.column_stack(
            [np.interp(distances, walked, self.path[:, 0]), np.interp(distances, walked, self.path[:, 1])]
        )

    def cast(self, origins: Array, directions: Array, times: Array) -> tuple[Array, Array]:
        """Cast beams onto the person.

        Parameters
        ----------
        origins, directions : origin and unit vector of each beam, shape (n, 2), world frame [m].
        times : of each beam, shape (n,) [s].

        Returns
        -------
        ranges : shape (n,) [m]; inf where a beam misses, 0 where it starts inside.
        cos_incidence : cosine of the angle between beam and surface normal, shape (n,).
        """
        to_centre = self.at(times) - origins
        ahead = (to_centre * directions).sum(axis=1)
        aside = directions[:, 0] * to_centre[:, 1] - directions[:, 1] * to_centre[:, 0]
        half_chord = np.sqrt(np.maximum(self.radius**2 - aside**2, 0.0))
        inside = (to_centre**2).sum(axis=1) <= self.radius**2
        hit = (abs(aside) <= self.radius) & (ahead > 0.0)
        ranges = np.where(inside, 0.0, np.where(hit, ahead - half_chord, np.inf))
        return ranges, half_chord / self.radius
