"""The view of a frame: corners and lines of its scan, or landmarks that the sensor found itself."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.frame import LandmarkObservations
from features.feature import Corners, Features
from features.scan import LaserScan
from features.sensor import SensorModel
from slam.graph.values import Observations
from slam.observed import observed_points


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What a frame shows of the surroundings.

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


class Extractor(Protocol):
    """Finds the features of a scan; :func:`features.extraction.extract` with its rules is the one that comes along."""

    def __call__(self, scan: LaserScan, sensor: SensorModel) -> Features:
        """Lines and corners of a scan, sensor frame, with covariances that follow from the noise of the sensor."""
        ...


def view_of_scan(scan: LaserScan, sensor: SensorModel, extractor: Extractor) -> View:
    """View that a scan without motion in it, sensor frame, gives."""
    features = extractor(scan, sensor)
    return View(features.corners.to_robot(sensor.mounting), scan, features)


def view_of_observations(observations: LandmarkObservations, sensor: SensorModel, *, use_identities: bool) -> View:
    """View that landmarks found by the sensor itself give, with their identities where these may be used."""
    points_robot, identities = observed_points(observations, sensor)
    return View(points_robot, identities=identities if use_identities else None)
