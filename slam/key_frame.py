"""What a frame shows, and what is kept of it when it becomes a key frame."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners, Features
from features.scan import LaserScan
from features.se2 import Array
from features.sensor import SensorModel
from slam.graph import Observations


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a frame shows.

    Parameters
    ----------
    corners_robot : corners of its scan, or landmarks that the sensor found itself, robot frame.
    scan : without the motion during it, sensor frame; None where the sensor finds landmarks itself.
    features : lines and corners of the scan, sensor frame.
    identities : of the landmarks, shape (k,), where they are known.
    """

    corners_robot: Corners
    scan: LaserScan | None = None
    features: Features | None = None
    identities: NDArray[np.int64] | None = None

    def observations(self, landmarks: np.ndarray, scatter: float) -> Observations:
        """Corners as observations of landmarks.

        Parameters
        ----------
        landmarks : landmark of each corner, -1 for none, shape (k,).
        scatter : standard deviation of a real corner, in x and y, beyond the noise of the sensor [m].
        """
        observed = landmarks >= 0
        corners = self.corners_robot
        covs = corners.covs[observed] + scatter**2 * np.eye(2)
        return Observations(landmarks[observed], corners.positions[observed], covs)


@dataclass(frozen=True, slots=True, eq=False)
class KeyFrame:
    """A frame that the graph holds.

    Parameters
    ----------
    record : its number.
    walls_robot : ends of the lines of its scan, robot frame, shape (L, 2, 2) [m].
    points_robot : points of its scan, robot frame, shape (n, 2) [m].
    """

    record: int
    walls_robot: Array
    points_robot: Array

    @classmethod
    def of(cls, record: int, view: View, sensor: SensorModel) -> "KeyFrame":
        """Keep what the map draws of a view."""
        scan = view.scan
        if scan is None or view.features is None:
            return cls(record, np.empty((0, 2, 2)), np.empty((0, 2)))
        seen = (scan.ranges > 0.0) & (scan.ranges >= sensor.range_min) & (scan.ranges <= sensor.range_max)
        ranges, angles = scan.ranges[seen], scan.angles[seen]
        points_sensor = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
        mounting = sensor.mounting
        return cls(record, mounting.points_to_robot(view.features.lines.ends), mounting.points_to_robot(points_sensor))
