"""The view of a frame: corners and lines of its scan, or landmarks that the sensor found itself."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.frame import LandmarkObservations
from features.feature import Corners, Features, Lines
from features.scan import LaserScan
from features.se2 import Array
from features.sensor import SensorModel
from slam.graph.values import Observations
from slam.observed import observed_points
from slam.odometry.deskew import Sweep, doubt_corners


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


def view_of_scan(scan: LaserScan, sensor: SensorModel, extractor: Extractor, sweep: Sweep | None = None) -> View:
    """View that a scan without motion in it, sensor frame, gives; lines and corners without a covariance are left out.

    The doubt of the motion that was undone, during a ``sweep``, enters the covariance of the corners.
    """
    features = extractor(scan, sensor)
    lines, corners = features.lines, features.corners
    known = _determined(lines.params, lines.covs) & (lines.ends[:, 0] != lines.ends[:, 1]).any(axis=1)
    known &= np.isfinite(lines.ends).all(axis=(1, 2))
    features = Features(Lines(lines.records[known]), Corners(corners.records[_known(corners)]))
    corners_robot = features.corners.to_robot(sensor.mounting)
    if sweep is not None:
        corners_robot = doubt_corners(corners_robot, scan, sensor.mounting, sweep)
    return View(corners_robot, scan, features)


def _known(corners: Corners) -> NDArray[np.bool_]:
    """Whether each corner has a covariance and is not at the origin, where it would have no bearing, shape (n,)."""
    positions = corners.positions
    away = np.abs(positions).max(axis=1, initial=0.0) > np.finfo(np.float64).eps
    return _determined(positions, corners.covs) & away


def _determined(params: Array, covs: Array) -> NDArray[np.bool_]:
    """Whether pairs of parameters, shape (n, 2), have covariances, shape (n, 2, 2), that double precision resolves.

    A fit that has not converged gives a covariance that is singular, infinite or NaN; what is computed with it is NaN.
    """
    eps = np.finfo(np.float64).eps
    first, second, mixed = covs[:, 0, 0], covs[:, 1, 1], covs[:, 0, 1]
    with np.errstate(over="ignore", invalid="ignore"):
        resolved = (np.minimum(first, second) > eps**2) & (np.maximum(first, second) < eps**-2)
        return resolved & (first * second - mixed**2 > eps * first * second) & np.isfinite(params).all(axis=1)


def view_of_observations(observations: LandmarkObservations, sensor: SensorModel, *, use_identities: bool) -> View:
    """View that landmarks found by the sensor itself give, with their identities where these may be used."""
    points_robot, identities = observed_points(observations, sensor)
    known = _known(points_robot)
    points_robot = Corners(points_robot.records[known])
    return View(points_robot, identities=identities[known] if use_identities and identities is not None else None)
