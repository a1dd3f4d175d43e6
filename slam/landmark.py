"""What is remembered of each landmark beside its position: the signature of its corner and how often it was seen."""

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array


class LandmarkTable:
    """Signature and count of every landmark, in the order of the filter's state."""

    def __init__(self) -> None:
        self._sums: Array = np.empty((0, 3))
        self.convex: NDArray[np.bool_] = np.empty(0, np.bool_)
        self.observations: NDArray[np.int64] = np.empty(0, np.int64)

    def __len__(self) -> int:
        return self.observations.size

    @property
    def opening_angles(self) -> Array:
        """Mean opening angle of each landmark, shape (n,) [rad]."""
        return self._sums[:, 0] / self.observations

    @property
    def orientations(self) -> Array:
        """Mean orientation of each landmark, world frame, shape (n,) [rad]."""
        return np.arctan2(self._sums[:, 2], self._sums[:, 1])

    def add(self, corners_robot: Corners, chosen: NDArray[np.int64], heading: float) -> NDArray[np.int64]:
        """Append a landmark for each of the chosen corners; return their indices."""
        first = len(self)
        self._sums = np.concatenate([self._sums, _signature(corners_robot, chosen, heading)])
        self.convex = np.concatenate([self.convex, corners_robot.convex[chosen]])
        self.observations = np.concatenate([self.observations, np.ones(len(chosen), np.int64)])
        return np.arange(first, len(self))

    def see(
        self,
        landmarks: NDArray[np.int64],
        corners_robot: Corners,
        chosen: NDArray[np.int64],
        heading: float,
    ) -> None:
        """Count the chosen corners as observations of these landmarks, each landmark at most once."""
        self._sums[landmarks] += _signature(corners_robot, chosen, heading)
        self.observations[landmarks] += 1


def _signature(corners_robot: Corners, chosen: NDArray[np.int64], heading: float) -> Array:
    directions = corners_robot.orientations[chosen] + heading
    return np.stack([corners_robot.opening_angles[chosen], np.cos(directions), np.sin(directions)], axis=-1)
