"""The walls and points that are kept of each key frame for the map."""

from dataclasses import dataclass

import numpy as np

from features.se2 import Array
from features.sensor import SensorModel
from slam.view import View


@dataclass(frozen=True, slots=True, eq=False)
class KeyFrame:
    """Walls and points of a key frame, kept for the map.

    Parameters
    ----------
    scan : number of its scan.
    walls_robot : ends of the lines of its scan, robot frame, shape (L, 2, 2) [m].
    points_robot : points of its scan, robot frame, shape (n, 2) [m].
    """

    scan: int
    walls_robot: Array
    points_robot: Array

    @classmethod
    def of(cls, number: int, view: View, sensor: SensorModel) -> "KeyFrame":
        """Take the walls and points of a view."""
        scan = view.scan
        if scan is None or view.features is None:
            return cls(number, np.empty((0, 2, 2)), np.empty((0, 2)))
        seen = sensor.returned(scan.ranges)
        ranges, angles = scan.ranges[seen], scan.angles[seen]
        points_sensor = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
        mounting = sensor.mounting
        return cls(number, mounting.points_to_robot(view.features.lines.ends), mounting.points_to_robot(points_sensor))
