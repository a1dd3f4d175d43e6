"""Measure whether registrations are as good as they claim: python docs/measure_registration.py [ROOM ...].

A ROOM is a kind of generated room, such as random-room. In each of 40 rooms of a kind a robot takes a scan, moves by up
to 0.3 m and 11 deg, takes another one, and registers it to the walls of the first, from a prediction that is off by 5
cm and 3 deg (one sigma), six times. Printed is a table in Markdown: NEES/3 of the pose (1 is right), NEES of each
coordinate, and the share of poses outside of their 99 % gate, with the paper's noise and with the effects of an S1 that
stands still while it scans. It takes some minutes.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from features.extraction import extract
from features.scan import LaserScan
from features.se2 import Array, Pose, compose, rotation, wrap_angle
from sim import EFFECTS, Lidar, World, find_site
from slam.config import SlamConfig
from slam.odometry.line_map import LineMap, walls_of_lines
from slam.odometry.registration import register
from slam.odometry.rules import RegistrationRules
from slam.odometry.scan_points import ScanPoints, scan_points

CONFIG = SlamConfig.of_preset("rplidar-s1")
SENSOR = CONFIG.sensor.model()
LINE_DISTANCE = 0.1
ROOMS, TRIALS = 40, 6
PRIOR = np.diag([0.05, 0.05, math.radians(3.0)]) ** 2


def points_of(scan: LaserScan) -> ScanPoints:
    """Points and lines of a scan."""
    lines = extract(scan, SENSOR, CONFIG.extraction).lines
    return scan_points(scan, walls_of_lines(lines, SENSOR.mounting), SENSOR, LINE_DISTANCE)


def trial(world: World, lidar: Lidar, first: Pose, motion: Pose, rng: np.random.Generator) -> Array:
    """NEES of the pose of a second scan and of each of its coordinates, shape (4,)."""
    line_map = LineMap(1)
    line_map.add(points_of(lidar.scan(world, first, 0.0, rng)).walls_robot, first)
    truth = compose(first, motion)
    scan = points_of(lidar.scan(world, truth, 0.0, rng))
    axes = np.eye(3)
    axes[:2, :2] = rotation(truth[2])
    prior = compose(truth, rng.multivariate_normal(np.zeros(3), PRIOR))
    prior_cov = axes @ PRIOR @ axes.T
    fit = register(scan, line_map.walls, prior, prior_cov, prior, RegistrationRules())
    cov = np.linalg.solve(np.eye(3) + prior_cov @ fit.information, prior_cov)
    error = fit.pose_map_robot - truth
    error[2] = wrap_angle(float(error[2]))
    return np.array([error @ np.linalg.solve(cov, error), *(error**2 / cov.diagonal())])


def trials(kind: str, lidar: Lidar) -> Iterator[Array]:
    """NEES of all trials in rooms of a kind."""
    for seed in range(1, ROOMS + 1):
        site = find_site(f"{kind}-{seed}")
        world, rng, path = site.world(), np.random.default_rng(seed), site.waypoints
        assert path is not None
        for _ in range(TRIALS):
            begin = int(rng.integers(0, len(path) - 1))
            way = path[begin + 1] - path[begin]
            first = np.array([*(path[begin] + rng.uniform() * way), math.atan2(way[1], way[0])])
            yield trial(world, lidar, first, np.array([rng.uniform(0.0, 0.3), 0.0, rng.uniform(-0.2, 0.2)]), rng)


def main() -> None:
    """Print a row for each kind of room, without and with effects."""
    print("| room | effects | NEES/3 | x | y | heading | outside 99 % |\n|---|---|---|---|---|---|---|")
    for kind in sys.argv[1:] or ["random-room", "cluttered-room"]:
        for name in ("ideal", "rplidar-s1"):
            lidar = Lidar.of_preset("rplidar-s1", effects=replace(EFFECTS[name], sweep_time=0.0))
            nees = np.array(list(trials(kind, lidar)))
            x, y, heading = nees[:, 1:].mean(axis=0)
            outside = (nees[:, 0] > chi2.ppf(0.99, 3)).mean()
            cells = f"{nees[:, 0].mean() / 3.0:.2f} | {x:.2f} | {y:.2f} | {heading:.2f} | {outside:.1%}"
            print(f"| {kind} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
