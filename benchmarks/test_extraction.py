"""Lines and corners of one scan of the room: compiled, and in plain numpy."""

from dataclasses import replace

import numpy as np
import pytest

from features.config import METHODS, ExtractionConfig
from features.extraction import extract
from features.feature import LINE_RECORD
from features.fitting.fit_kernels import fit_kernel
from features.se2 import pose
from features.sensor import sensor_preset
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from slam.study.paper.timing_kernels import polar_line_literal

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


@pytest.mark.parametrize("beams", [180, 920, 5_000, 20_000])
def test_extract_grows_with_the_beams(benchmark, rng, beams):
    benchmark.group = "extract, one room, by beams"
    s1 = Lidar.of_preset("rplidar-s1")
    lidar = replace(s1, angles=np.linspace(-np.pi, np.pi, beams, endpoint=False))
    scan = lidar.scan(room(), pose(2.0, 2.0, 0.5), 0.0, rng)
    features = benchmark(extract, scan, sensor_preset("rplidar-s1"))
    assert len(features.corners) > 0


@pytest.mark.parametrize("points", [10, 100, 1_000])
@pytest.mark.parametrize("fit", ["cwlf", "arras-siegwart", "effective-variance", "total-least-squares"])
def test_line_fit(benchmark, rng, fit, points):
    benchmark.group = f"line fit, {points} points"
    angles = np.linspace(-0.5, 0.5, points)
    ranges = 3.0 / np.cos(angles) + rng.normal(0.0, 0.02, points)
    line = np.empty(1, LINE_RECORD)[0]
    xs, ys = ranges * np.cos(angles), ranges * np.sin(angles)
    method = METHODS.index((fit, "propagated"))
    assert benchmark(fit_kernel, xs, ys, 0.02**2, 0.002**2, method, line)


@pytest.mark.parametrize("points", [10, 100, 1_000])
def test_line_fit_arras_siegwart_as_printed(benchmark, rng, points):
    """Only the parameters: eq. 17 by its double sums, without eq. 19."""
    benchmark.group = f"line fit, {points} points"
    angles = np.linspace(-0.5, 0.5, points)
    ranges = 3.0 / np.cos(angles) + rng.normal(0.0, 0.02, points)
    line = np.empty(7)
    benchmark(polar_line_literal, ranges, angles, 0.02**2, 0.002**2, line)
    assert abs(line[0]) < 0.1
