"""What a frame shows, and what is kept of it when it becomes a key frame."""

from dataclasses import dataclass

import numpy as np

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
    scan : without the motion during it, sensor frame.
    features : its lines and corners, sensor frame.
    corners_robot : its corners, robot frame.
    """

    scan: LaserScan
    features: Features
    corners_robot: Corners

    def observations(self, landmarks: np.ndarray) -> Observations:
        """Corners as observations of landmarks, given the landmark of each, -1 for none, shape (k,)."""
        observed = landmarks >= 0
        corners = self.corners_robot
        return Observations(landmarks[observed], corners.positions[observed], corners.covs[observed])


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
        seen = (scan.ranges > 0.0) & (scan.ranges >= sensor.range_min) & (scan.ranges <= sensor.range_max)
        ranges, angles = scan.ranges[seen], scan.angles[seen]
        points_sensor = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
        mounting = sensor.mounting
        return cls(record, mounting.points_to_robot(view.features.lines.ends), mounting.points_to_robot(points_sensor))
