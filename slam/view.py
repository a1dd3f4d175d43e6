"""What a frame shows of the surroundings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.frame import Frame
from features.extract import extract
from features.feature import Corners, Features
from features.scan import LaserScan
from features.sensor import SensorModel
from slam.config import SlamConfig
from slam.errors import ConfigError
from slam.graph.values import Observations
from slam.observed import observed_points
from slam.odometry.deskew import deskew_by_odometry
from slam.result.records import Records


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


def look(frame: Frame, config: SlamConfig, sensor: SensorModel, records: Records) -> View | None:
    """Return what a frame shows; None for a record of odometry only.

    Parameters
    ----------
    frame : the newest of ``records``.
    config : of the run.
    sensor : its sensor.
    records : so far; they tell how the robot moved during the scan.

    Raises
    ------
    ConfigError
        Landmarks that a sensor found itself cannot be used without wheels.
    """
    if frame.scan is not None:
        return _scanned(frame.scan, config, sensor, records)
    if frame.observations is None:
        return None
    if config.odometry.source == "lines":
        raise ConfigError("odometry.source is 'lines', but the source has no scans: expected 'line-aided' or 'wheel'")
    points_robot, identities = observed_points(frame.observations, sensor)
    return View(points_robot, identities=identities if config.front_end.use_identities else None)


def _scanned(scan: LaserScan, config: SlamConfig, sensor: SensorModel, records: Records) -> View:
    if config.front_end.deskew:
        # Without wheels the poses found so far tell how the robot moves.
        poses = records.poses_map if config.odometry.source == "lines" else records.poses_odom
        scan = deskew_by_odometry(scan, sensor, records.stamps, poses)
    features = extract(scan, sensor, config.extraction)
    return View(features.corners.to_robot(sensor.mounting), scan, features)
