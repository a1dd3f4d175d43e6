"""A feature of your own: round columns of a known radius as landmarks, beside the corners.

The extractor fulfils :class:`slam.view.Extractor` and nothing else of the project changes.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from features import Corners, Features, LaserScan, SensorModel, extract
from features.se2 import Array, transform
from features.signature import Kind, Signatures
from sim import Lidar, Site, World, site_run
from slam import Slam, SlamConfig, Trajectory, ate

RADIUS = 0.25
COLUMNS = np.array([[2.5, 2.0], [5.5, 4.2]])


class CornersAndColumns:
    """Corners as they come with the project, and the centres of columns as points."""

    def __call__(self, scan: LaserScan, sensor: SensorModel) -> Features:
        """Extract lines, corners and columns, sensor frame."""
        features = extract(scan, sensor)
        found = [column for points in clusters(scan, sensor) if (column := fit_column(points, sensor)) is not None]
        if not found:
            return features
        centres, covs = (np.array(values) for values in zip(*found, strict=True))
        columns = Corners.of(centres, covs, Signatures.of_points(len(found)))
        return Features(features.lines, Corners(np.concatenate([features.corners.records, columns.records])))


def clusters(scan: LaserScan, sensor: SensorModel) -> list[Array]:
    """Points of neighbouring beams that jump by less than 0.2 m, as wide as a column and nearer than what is beside."""
    returned = sensor.returned(scan.ranges)
    ranges, angles = scan.ranges[returned], scan.angles[returned]
    points = ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    breaks = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) > 0.2) + 1
    parts = np.split(points, breaks)[1:-1]
    return [part for part in parts if len(part) > 8 and RADIUS < np.hypot(*(part[-1] - part[0])) < 2.2 * RADIUS]


def fit_column(points: Array, sensor: SensorModel) -> tuple[Array, NDArray[np.floating]] | None:
    """Centre of a circle of the known radius and its covariance; None where the points are no circle."""
    middle = points.mean(axis=0)
    start = middle * (1.0 + RADIUS / np.hypot(*middle))
    fit = least_squares(lambda centre: np.hypot(*(points - centre).T) - RADIUS, start)
    variance = sensor.sigma_range**2
    if 2.0 * fit.cost > 3.0 * variance * len(points):
        return None
    jacobian = np.asarray(fit.jac, np.float64)
    return fit.x, variance * np.linalg.inv(jacobian.T @ jacobian)


def hall() -> Site:
    """Build a hall with two columns, and a path through it."""
    turn = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    circle = RADIUS * np.column_stack([np.cos(turn), np.sin(turn)])
    walls = [(0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)]
    world = World.from_polygons("hall", [walls, *((circle + centre).tolist() for centre in COLUMNS)])
    return Site.of(world, [[1.0, 1.0], [7.0, 1.0], [7.0, 5.0], [1.0, 5.0], [1.0, 1.0]])


if __name__ == "__main__":
    run = site_run(hall(), Lidar.of_preset("rplidar-s1"), "rplidar-s1", seed=1)
    slam = Slam(SlamConfig.of_preset(run.sensor, run.mounting), extractor=CornersAndColumns())
    for frame in run:
        slam.process(frame)
    result = slam.finish()
    landmarks = result.landmarks
    alignment = ate(Trajectory(run.stamps, run.poses_world_robot), result.trajectory).pose_truth_estimate
    for x, y in transform(alignment, landmarks.positions[landmarks.signatures.kinds == Kind.POINT]):
        print(f"column at ({x:.3f}, {y:.3f}) m")
    print(f"{len(landmarks)} landmarks in all")
