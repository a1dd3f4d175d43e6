"""Registration of a scan to the walls of 30 key frames, beside the extraction of its lines in the same run."""

import numpy as np
import pytest

from features.extraction import extract
from features.se2 import compose, pose
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from slam.config import SlamConfig
from slam.odometry.line_map import LineMap, walls_of_lines
from slam.odometry.registration import register
from slam.odometry.rules import RegistrationRules
from slam.odometry.scan_points import scan_points

HERE = pose(2.2, 1.7, 0.6)
PRESETS = ["sick-lms", "rplidar-s1"]


def problem(preset, rng):
    """A scan, its lines, and the walls of 30 key frames on the way to it."""
    lidar = Lidar.of_preset(preset, None)
    config = SlamConfig.of_preset(preset)
    sensor = config.sensor.model()
    line_map = LineMap(30)
    for k in range(30):
        at = compose(HERE, pose(0.05 * k - 1.5, 0.0, 0.0))
        lines = extract(lidar.scan(room(), at, 0.0, rng), sensor, config.extraction).lines
        line_map.add(walls_of_lines(lines, sensor.mounting), at)
    scan = lidar.scan(room(), HERE, 0.0, rng)
    return scan, sensor, config.extraction, line_map.walls


@pytest.mark.parametrize("preset", PRESETS)
def test_register(benchmark, rng, preset):
    benchmark.group = f"one scan, {preset}"
    scan, sensor, extraction, walls = problem(preset, rng)
    lines = extract(scan, sensor, extraction).lines
    prior = compose(HERE, pose(0.03, -0.02, 0.02))
    cov = np.diag([0.02, 0.02, 0.02]) ** 2
    rules = RegistrationRules()

    def registered():
        points = scan_points(scan, walls_of_lines(lines, sensor.mounting), sensor, 0.1)
        return register(points, walls, prior, cov, prior, rules)

    fit = benchmark(registered)
    np.testing.assert_allclose(fit.pose_map_robot, HERE, atol=0.02)


@pytest.mark.parametrize("preset", PRESETS)
def test_extract(benchmark, rng, preset):
    benchmark.group = f"one scan, {preset}"
    scan, sensor, extraction, _ = problem(preset, rng)
    assert len(benchmark(extract, scan, sensor, extraction).lines) > 3
