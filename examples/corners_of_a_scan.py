"""Extract the corners of one simulated scan and print them beside the true ones."""

import numpy as np

from features import extract, sensor_preset
from features.se2 import pose, transform
from sim import Lidar, room

world = room()
pose_world_robot = pose(2.0, 2.0, 0.5)
scan = Lidar.of_preset("rplidar-s1").scan(world, pose_world_robot, 0.0, np.random.default_rng(1))

for corner in extract(scan, sensor_preset("rplidar-s1")).corners:
    x, y = transform(pose_world_robot, corner.position)
    true = world.corners[np.argmin(np.hypot(*(world.corners - (x, y)).T))]
    sigma_mm = 1e3 * np.sqrt(np.diag(corner.cov))
    kind = "convex " if corner.convex else "concave"
    print(
        f"{kind} corner at ({x:.3f}, {y:.3f}) m, {np.degrees(corner.opening_angle):3.0f} deg, sigma "
        f"{sigma_mm[0]:.1f} and {sigma_mm[1]:.1f} mm; true ({true[0]:.3f}, {true[1]:.3f}) m"
    )
