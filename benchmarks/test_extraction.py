"""Lines and corners of one scan of the room: compiled, and in plain numpy."""

import pytest

from features.config import ExtractionConfig
from features.extract import extract
from features.se2 import pose
from features.sensor import sensor_preset
from sim.lidar import Lidar
from sim.worlds import room

PRESETS = {920: "rplidar-s1", 180: "sick-lms"}


def scan_of(beams, rng):
    preset = PRESETS[beams]
    scan = Lidar.of_preset(preset).scan(room(), pose(2.0, 2.0, 0.5), 0.0, rng)
    assert len(scan) == beams
    return scan, sensor_preset(preset), ExtractionConfig()


@pytest.mark.parametrize("beams", PRESETS)
def test_extract_compiled(benchmark, rng, beams):
    benchmark.group = f"extract, {beams} beams"
    features = benchmark(extract, *scan_of(beams, rng))
    assert len(features.corners) > 0


@pytest.mark.parametrize("beams", PRESETS)
def test_extract_numpy(benchmark, rng, beams, extraction_twin):
    benchmark.group = f"extract, {beams} beams"
    scan, model, config = scan_of(beams, rng)
    _, corners = benchmark(extraction_twin.extract, scan.ranges, scan.angles, model, config)
    assert len(corners) == len(extract(scan, model, config).corners)
