"""Landmarks that a sensor has found by itself, as the points that the filter takes."""

import numpy as np
from numpy.typing import NDArray

from drivers.frame import LandmarkObservations
from features.feature import Corners
from features.sensor import SensorModel
from features.signature import Signatures


def observed_points(
    observations: LandmarkObservations, sensor: SensorModel
) -> tuple[Corners, NDArray[np.int64] | None]:
    """Points, robot frame, of the observations within the limits of the sensor, and their identities where known."""
    seen = sensor.returned(observations.ranges)
    ranges, bearings = observations.ranges[seen], observations.bearings[seen]
    if observations.covs is None:
        covs = np.broadcast_to(np.diag([sensor.sigma_range**2, sensor.sigma_bearing**2]), (ranges.size, 2, 2))
    else:
        covs = observations.covs[seen]
    c, s = np.cos(bearings), np.sin(bearings)
    by_polar = np.array([[c, -ranges * s], [s, ranges * c]]).transpose(2, 0, 1)
    points = Corners.of(
        positions=ranges[:, None] * np.stack([c, s], axis=-1),
        covs=by_polar @ covs @ by_polar.transpose(0, 2, 1),
        signatures=Signatures.of_points(ranges.size),
    )
    identities = observations.identities
    return points.to_robot(sensor.mounting), None if identities is None else identities[seen]
