"""Scenes of the feature tests: noise-free and noisy scans of walls whose corners are known."""

import numpy as np

from features import LaserScan
from features.se2 import Array, inverse, rotation, transform
from sim import Lidar, World

FULL_TURN = np.asarray(-np.pi + 2.0 * np.pi * np.arange(920) / 920.0)
HALF_TURN = np.asarray(np.radians(np.arange(-90.0, 90.5, 0.5)))


def exact_scan(
    world: World, angles: Array = FULL_TURN, pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> LaserScan:
    """Scan without noise, of a sensor at ``pose``."""
    ranges, _ = world.cast(np.array(pose), angles)
    return LaserScan(ranges, angles)


def noisy_scan(
    world: World,
    pose: Array,
    rng: np.random.Generator,
    sigma_range: float,
    sigma_bearing: float,
    angles: Array = FULL_TURN,
) -> LaserScan:
    """Scan with the noise of section III of the paper."""
    lidar = Lidar(angles, sigma_range, sigma_bearing, range_min=0.1, range_max=40.0, rate=10.0)
    return lidar.scan(world, pose, 0.0, rng)


def free_pose(world: World, rng: np.random.Generator, clearance: float = 0.5) -> Array:
    """Random pose in the room, at least ``clearance`` from every wall and not inside a pillar."""
    starts, along = world.walls[:, :2], world.walls[:, 2:] - world.walls[:, :2]
    low, high = world.walls.reshape(-1, 2).min(axis=0), world.walls.reshape(-1, 2).max(axis=0)
    while True:
        point = rng.uniform(low, high)
        share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        near = np.hypot(*(starts + share[:, None] * along - point).T).min() < clearance
        # Outside the outline and inside a pillar the walls are crossed an even number of times.
        above = (starts[:, 1] > point[1]) != (world.walls[:, 3] > point[1])
        slope = np.divide(along[:, 0], along[:, 1], out=np.zeros(len(along)), where=above)
        crossed = above & (point[0] < starts[:, 0] + slope * (point[1] - starts[:, 1]))
        if not near and crossed.sum() % 2 == 1:
            return np.array([*point, rng.uniform(-np.pi, np.pi)])


def corners_in_sensor_frame(world: World, pose: Array) -> Array:
    """True corners of the world, sensor frame, shape (k, 2)."""
    return transform(inverse(pose), world.corners)


def polygon(vertices, turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)) -> World:
    """World of one closed polygon, turned about the origin, then shifted."""
    return World.from_polygons("polygon", [np.asarray(vertices, dtype=np.float64) @ rotation(turn).T + np.array(shift)])


def square(half: float = 2.0, turn: float = 0.0, shift: tuple[float, float] = (0.0, 0.0)) -> World:
    """Square room around the origin, counter-clockwise."""
    return polygon([(half, half), (-half, half), (-half, -half), (half, -half)], turn, shift)


def sorted_corners(corners) -> tuple[Array, Array, Array, Array, Array]:
    """Positions, covariances, opening angles, orientations and kinds, ordered by position: a list starts anywhere."""
    order = np.lexsort(np.round(corners.positions, 6).T)
    return (
        corners.positions[order],
        corners.covs[order],
        corners.opening_angles[order],
        corners.orientations[order],
        corners.kinds[order],
    )
