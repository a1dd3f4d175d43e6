"""The simulated lidar: its noise as samples show it, its limits and its mounting."""

import dataclasses
import math

import numpy as np
import pytest
import shapely

from features.sensor import SENSOR_PRESETS, Mounting, sensor_preset
from sim import Lidar, World, effects_of, room

WALL = World("wall", np.array([[4.0, -500.0, 4.0, 500.0]]))
HERE = np.zeros(3)
POSE = np.array([2.4, 1.6, 0.7])
MOUNTINGS = [
    Mounting(),
    Mounting(x=0.2, y=-0.1),
    Mounting(theta=2.0),
    Mounting(upside_down=True),
    Mounting(x=-0.15, y=0.3, theta=-1.1, upside_down=True),
]
BEAMS = 200_000
FIVE_SIGMA_VARIANCE = 5.0 * math.sqrt(2.0 / BEAMS)
"""Five standard errors of a normal sample's variance, relative: a right sampler fails once in two million."""


def lidar(angles, sigma_range=0.0, sigma_bearing=0.0, range_min=0.0, range_max=1e3, mounting=None):
    return Lidar(
        angles=np.asarray(angles, dtype=np.float64),
        sigma_range=sigma_range,
        sigma_bearing=sigma_bearing,
        range_min=range_min,
        range_max=range_max,
        rate=10.0,
        mounting=mounting or Mounting(),
    )


@pytest.mark.parametrize(
    ("preset", "beams", "rate"),
    [
        ("rplidar-s1", 920, 10.0),
        ("rplidar-a1", 800, 10.0),
        ("rplidar-a2", 800, 10.0),
        ("rplidar-a3", 1600, 10.0),
        ("rplidar-s2", 3200, 10.0),
        ("sick-lms", 180, 5.0),
    ],
)
def test_preset_has_the_sensors_beams_noise_and_limits(preset, beams, rate):
    scanner, model = Lidar.of_preset(preset, mounting=MOUNTINGS[-1]), sensor_preset(preset)
    assert (scanner.angles.size, scanner.rate) == (beams, rate)
    for name in ("sigma_range", "sigma_bearing", "range_min", "range_max"):
        assert getattr(scanner, name) == getattr(model, name)
    assert scanner.mounting == MOUNTINGS[-1]


def test_every_preset_but_that_of_the_camera_can_be_simulated_with_effects_of_its_own():
    for preset in set(SENSOR_PRESETS) - {"mrclam-camera"}:
        assert Lidar.of_preset(preset, effects=effects_of("on", preset)).effects.beam_width > 0.0
    with pytest.raises(ValueError, match="'mrclam-camera' is no laser scanner"):
        Lidar.of_preset("mrclam-camera")


def test_spacing_of_beams_is_what_the_presets_take_for_the_noise_of_a_bearing():
    """Uniform between neighbouring beams, within a twelfth: presets round the spacing."""
    for preset in set(SENSOR_PRESETS) - {"mrclam-camera", "sick-lms"}:
        spacing = np.diff(Lidar.of_preset(preset).angles)[0]
        np.testing.assert_allclose(spacing / math.sqrt(12.0), sensor_preset(preset).sigma_bearing, rtol=1.0 / 12.0)


def test_beams_of_the_presets_are_evenly_spaced():
    s1, sick = Lidar.of_preset("rplidar-s1").angles, Lidar.of_preset("sick-lms").angles
    np.testing.assert_allclose(np.diff(np.append(s1, s1[0] + 2.0 * np.pi)), 2.0 * np.pi / 920.0, atol=1e-12)
    np.testing.assert_allclose(np.degrees(sick), np.arange(-90, 90), atol=1e-12)


def test_range_noise_has_its_mean_and_variance():
    """Square on the wall, with no bearing noise, ranges are normal around 4 m."""
    scan = lidar(np.zeros(BEAMS), sigma_range=0.05).scan(WALL, HERE, 0.0, np.random.default_rng(0))
    assert abs(scan.ranges.mean() - 4.0) < 5.0 * 0.05 / math.sqrt(BEAMS)
    assert abs(scan.ranges.var() / 0.05**2 - 1.0) < FIVE_SIGMA_VARIANCE


@pytest.mark.parametrize("incidence_deg", [30.0, -60.0, 75.0])
def test_bearing_noise_is_applied_before_the_cast(incidence_deg):
    """On an oblique wall the variance of the range is sigma_range^2 + (r tan(incidence) sigma_bearing)^2.

    The formula is of first order; at 75 deg the next term is (tan^2 + 1/2) (2 sigma_bearing)^2 = 2e-4 of it, which the
    bound of 5 standard errors (1.6 %) covers.
    """
    incidence = math.radians(incidence_deg)
    scanner = lidar(np.full(BEAMS, incidence), sigma_range=0.01, sigma_bearing=0.002)
    scan = scanner.scan(WALL, HERE, 0.0, np.random.default_rng(1))
    r = 4.0 / math.cos(incidence)
    expected = 0.01**2 + (r * math.tan(incidence) * 0.002) ** 2
    assert abs(scan.ranges.var() / expected - 1.0) < FIVE_SIGMA_VARIANCE


def test_noise_of_beams_is_independent():
    """Neighbours, and range against the bearing that was drawn for the same beam, are uncorrelated."""
    scan = lidar(np.full(BEAMS, 1.0), 0.05, 0.002).scan(WALL, HERE, 0.0, np.random.default_rng(2))
    error = scan.ranges - scan.ranges.mean()
    assert abs((error[1:] * error[:-1]).mean() / error.var()) < 5.0 / math.sqrt(BEAMS)


def test_reported_angles_are_nominal():
    scanner = Lidar.of_preset("rplidar-s1")
    scan = scanner.scan(room(), POSE, 1.5, np.random.default_rng(0))
    np.testing.assert_array_equal(scan.angles, scanner.angles)
    assert scan.stamp == 1.5


def test_range_outside_the_limits_is_no_return():
    walls = np.array([[0.4, -0.1, 0.4, 0.1], [-8.0, -0.1, -8.0, 0.1], [-0.1, 4.0, 0.1, 4.0]])
    scanner = lidar([0.0, np.pi, np.pi / 2.0, -np.pi / 2.0], range_min=0.5, range_max=7.0)
    scan = scanner.scan(World("limits", walls), HERE, 0.0, np.random.default_rng(0))
    np.testing.assert_allclose(scan.ranges, [np.inf, np.inf, 4.0, np.inf], atol=1e-12)


def test_no_range_is_negative():
    """Noise as large as the range would make a sixth of them negative: these are no return."""
    scan = lidar(np.zeros(1000), sigma_range=4.0).scan(WALL, HERE, 0.0, np.random.default_rng(0))
    assert (scan.ranges >= 0.0).all()
    assert 100 < np.isinf(scan.ranges).sum() < 230


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_points_lie_on_the_walls_however_the_sensor_is_mounted(mounting):
    """Points carried to the world by the mounting's own functions lie on the walls, all around the robot."""
    angles = np.linspace(-np.pi, np.pi, 400, endpoint=False)
    scan = lidar(angles, mounting=mounting).scan(room(), POSE, 0.0, np.random.default_rng(0))
    points_sensor = scan.ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    points_robot = mounting.points_to_robot(points_sensor)
    c, s = np.cos(POSE[2]), np.sin(POSE[2])
    points_world = POSE[:2] + points_robot @ np.array([[c, s], [-s, c]])
    walls = shapely.multilinestrings([wall.reshape(2, 2) for wall in room().walls])
    assert shapely.distance(walls, shapely.points(points_world)).max() < 1e-9


@pytest.mark.parametrize("mounting", MOUNTINGS)
def test_a_mounted_sensor_equals_a_plain_one_at_its_place(mounting):
    """Seen from the sensor's place, a sensor upside down runs its angles the other way round."""
    angles = np.linspace(-2.0, 2.0, 301)
    mounted = lidar(angles, mounting=mounting).scan(room(), POSE, 0.0, np.random.default_rng(0))
    c, s = np.cos(POSE[2]), np.sin(POSE[2])
    offset = np.array([[c, -s], [s, c]]) @ [mounting.x, mounting.y]
    place = np.array([*(POSE[:2] + offset), POSE[2] + mounting.theta])
    plain = lidar(-angles if mounting.upside_down else angles).scan(room(), place, 0.0, np.random.default_rng(0))
    np.testing.assert_allclose(mounted.ranges, plain.ranges, rtol=0.0, atol=1e-9)


def test_same_generator_state_gives_the_same_bytes():
    scanner = Lidar.of_preset("rplidar-s1")
    first, second, other = (scanner.scan(room(), POSE, 0.0, np.random.default_rng(k)).ranges for k in (5, 5, 6))
    assert first.tobytes() == second.tobytes()
    assert first.tobytes() != other.tobytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sigma_range": -0.1}, "sigma_range"),
        ({"sigma_bearing": math.nan}, "sigma_bearing"),
        ({"rate": 0.0}, "rate"),
        ({"range_min": -1.0}, "range_min"),
        ({"range_max": 0.05}, "range_max"),
    ],
)
def test_impossible_lidar_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(Lidar.of_preset("rplidar-s1"), **change)


def test_unknown_preset_is_refused():
    with pytest.raises(ValueError, match="unknown sensor preset 'nonesuch'"):
        Lidar.of_preset("nonesuch")
