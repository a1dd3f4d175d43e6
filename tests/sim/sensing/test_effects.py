"""Effects beside the paper's noise: over 100,000 beams the sample has the mean and variance that each one states."""

import dataclasses
import math

import numpy as np
import pytest
import shapely

from features.sensor import Mounting
from sim import EFFECTS, Effects, Lidar, Person, World, room

BEAMS = 100_000
WALL = World("wall", np.array([[4.0, -500.0, 4.0, 500.0]]))
HERE = np.zeros(3)


def lidar(angles, sigma_range=0.0, sigma_bearing=0.0, range_max=1e4, **effects):
    return Lidar(
        np.asarray(angles, dtype=np.float64),
        sigma_range,
        sigma_bearing,
        0.0,
        range_max,
        10.0,
        Mounting(),
        Effects(**effects),
    )


def measure(scanner, world=WALL, poses=HERE, people=(), stamp=0.0, seed=0):
    return scanner.measure(world, poses, stamp, np.random.default_rng(seed), people)


def assert_mean(sample, mean, variance):
    """Five standard errors: a right sampler fails once in two million."""
    assert abs(sample.mean() - mean) < 5.0 * math.sqrt(variance / sample.size)


def assert_variance(sample, variance, kurtosis=3.0):
    """Five standard errors of a sample variance; its relative variance is (kurtosis - 1) / n, 3 normal, 1.8 uniform."""
    assert abs(sample.var() / variance - 1.0) < 5.0 * math.sqrt((kurtosis - 1.0) / sample.size)


def assert_share(chosen, probability):
    assert_mean(chosen.astype(float), probability, probability * (1.0 - probability))


def test_all_effects_are_off_by_default():
    """No draw is spent on them either: the scan is that of the paper's model, to the last bit."""
    rng, angles = np.random.default_rng(3), np.linspace(-3.0, 3.0, 500)
    directions = angles + 0.002 * rng.standard_normal(500)
    expected = room().cast(np.array([2.2, 1.7, 0.0]), directions)[0] + 0.02 * rng.standard_normal(500)
    found = measure(lidar(angles, 0.02, 0.002), room(), np.array([2.2, 1.7, 0.0]), seed=3)
    np.testing.assert_array_equal(found.scan.ranges, expected)
    assert found.scan.times is None
    assert Effects() == EFFECTS["ideal"]


@pytest.mark.parametrize("distance", [1.0, 4.0, 25.0])
def test_range_growth_has_its_mean_and_variance(distance):
    world = World("wall", np.array([[distance, -1.0, distance, 1.0]]))
    ranges = measure(lidar(np.zeros(BEAMS), 0.02, range_growth=0.005), world).scan.ranges
    variance = 0.02**2 + (0.005 * distance) ** 2
    assert_mean(ranges, distance, variance)
    assert_variance(ranges, variance)


@pytest.mark.parametrize("incidence_deg", [30.0, 60.0])
def test_beam_width_has_its_mean_and_variance(incidence_deg):
    """On an oblique wall the echo comes from w/2 on either side: uniform, of variance (r tan(i) w)^2 / 12.

    Terms of second order, (tan^2 + 1/2) w^2 / 12 of the range in the mean, are below 2e-6 of it.
    """
    incidence = math.radians(incidence_deg)
    ranges = measure(lidar(np.full(BEAMS, incidence), beam_width=2e-3)).scan.ranges
    r = 4.0 / math.cos(incidence)
    variance = (r * math.tan(incidence) * 2e-3) ** 2 / 12.0
    assert_mean(ranges, r, variance + BEAMS / 25.0 * (2e-6 * r) ** 2)
    assert_variance(ranges, variance, kurtosis=1.8)


def test_beam_width_adds_to_the_noise_of_the_bearing():
    ranges = measure(lidar(np.full(BEAMS, 1.0), sigma_bearing=1e-3, beam_width=4e-3)).scan.ranges
    r = 4.0 / math.cos(1.0)
    # Second order at 1 rad: (tan^2 + 1/2) (2 sigma)^2 = 2e-5 of the variance.
    assert_variance(ranges, (r * math.tan(1.0)) ** 2 * (1e-3**2 + 4e-3**2 / 12.0))


def test_mixed_pixels_lie_evenly_between_what_the_edges_hit():
    """The near wall ends at the middle of the beam; half of the others see it, half what is behind."""
    world = World("edge", np.array([[2.0, 0.0, 2.0, 3.0], [5.0, -9.0, 5.0, 9.0]]))
    found = measure(lidar(np.zeros(BEAMS), beam_width=2e-3, mixed_share=0.3), world)
    assert_share(found.mixed, 0.3)
    mixed, others = found.scan.ranges[found.mixed], found.scan.ranges[~found.mixed]
    assert_mean(mixed, 3.5, 9.0 / 12.0)
    assert_variance(mixed, 9.0 / 12.0, kurtosis=1.8)
    assert_share(others < 3.0, 0.5)
    # Nothing but the two walls: a beam of 1 mrad off is longer by 5e-7 of its range.
    assert (np.minimum(abs(others - 2.0), abs(others - 5.0)) < 1e-5).all()
    np.testing.assert_array_equal(found.wall_ids == 0, found.ranges < 3.0)


def test_beams_within_one_wall_or_beside_the_open_are_not_mixed():
    world = World("edge", np.array([[2.0, 0.0, 2.0, 3.0]]))
    for direction in (0.3, 0.0):
        assert not measure(lidar(np.full(1000, direction), beam_width=2e-3, mixed_share=1.0), world).mixed.any()


def test_lost_beams_have_their_share_wherever_they_go():
    found = measure(lidar(np.linspace(-1.0, 1.0, BEAMS), lost_share=0.07))
    assert_share(np.isinf(found.scan.ranges), 0.07)
    assert (found.wall_ids == 0).all()


@pytest.mark.parametrize(("distance", "incidence_deg"), [(5.0, 0.0), (20.0, 0.0), (20.0, 60.0), (35.0, -75.0)])
def test_fading_follows_range_and_incidence(distance, incidence_deg):
    """exp(-(r / fade_range)^2 / cos(i)), times those not lost anyway."""
    incidence = math.radians(incidence_deg)
    across = distance * math.cos(incidence)
    world = World("wall", np.array([[across, -900.0, across, 900.0]]))
    found = measure(lidar(np.full(BEAMS, incidence), lost_share=0.05, fade_range=30.0), world)
    expected = 0.95 * math.exp(-((distance / 30.0) ** 2) / math.cos(incidence))
    assert_share(np.isfinite(found.scan.ranges), expected)


def test_range_steps_err_evenly_over_one_step():
    """Ranges spread over thousands of steps: the error is uniform, of variance step^2 / 12."""
    found = measure(lidar(np.random.default_rng(1).uniform(-1.2, 1.2, BEAMS), range_step=0.01))
    error = found.scan.ranges - found.ranges
    np.testing.assert_allclose(found.scan.ranges / 0.01, np.round(found.scan.ranges / 0.01), rtol=0.0, atol=1e-9)
    assert abs(error).max() <= 0.005 + 1e-12
    assert_mean(error, 0.0, 0.01**2 / 12.0)
    assert_variance(error, 0.01**2 / 12.0, kurtosis=1.8)


def test_angle_steps_err_evenly_over_one_step_and_ranges_know_nothing_of_them():
    angles = np.random.default_rng(1).uniform(-1.2, 1.2, BEAMS)
    step = math.radians(1.0 / 64.0)
    found = measure(lidar(angles, angle_step=step))
    error = found.scan.angles - angles
    np.testing.assert_allclose(found.scan.angles / step, np.round(found.scan.angles / step), rtol=0.0, atol=1e-6)
    assert_mean(error, 0.0, step**2 / 12.0)
    assert_variance(error, step**2 / 12.0, kurtosis=1.8)
    np.testing.assert_allclose(found.scan.ranges, 4.0 / np.cos(angles), rtol=0.0, atol=1e-9)


def test_maximum_range_is_no_return():
    """A wall at the limit: noise takes half of the beams beyond it."""
    found = measure(lidar(np.zeros(BEAMS), sigma_range=0.02, range_max=4.0))
    assert_share(np.isinf(found.scan.ranges), 0.5)
    assert found.scan.ranges[np.isfinite(found.scan.ranges)].max() <= 4.0


def test_beams_of_a_sweep_are_cast_from_where_the_robot_is_then():
    scanner = dataclasses.replace(lidar(np.linspace(-3.0, 3.0, 500), sweep_time=0.1), mounting=Mounting(0.2, -0.1, 0.4))
    np.testing.assert_allclose(np.diff(scanner.times), 0.1 / 500, rtol=1e-9)
    assert scanner.times[-1] == 0.0
    stamp = 2.0 + scanner.times
    poses = np.column_stack([2.0 + 0.5 * stamp, 2.0 - 0.1 * stamp, stamp])
    found = measure(scanner, room(), poses, stamp=2.0)
    assert found.scan.times is not None
    np.testing.assert_array_equal(found.scan.times, scanner.times)
    for beam in range(0, 500, 50):
        x, y, heading = poses[beam]
        c, s = math.cos(heading), math.sin(heading)
        place = np.array([x + 0.2 * c + 0.1 * s, y + 0.2 * s - 0.1 * c, heading + 0.4])
        expected, wall_ids = room().cast(place, scanner.angles[beam : beam + 1])
        np.testing.assert_allclose(found.scan.ranges[beam], expected[0], rtol=0.0, atol=1e-9)
        assert found.wall_ids[beam] == wall_ids[0]


def test_sweep_of_a_robot_at_rest_is_a_scan_at_once():
    angles = np.linspace(-3.0, 3.0, 500)
    place = np.array([2.2, 1.7, 0.3])
    at_once = measure(lidar(angles, 0.02, 0.002), room(), place)
    sweep = measure(lidar(angles, 0.02, 0.002, sweep_time=0.1), room(), np.tile(place, (500, 1)))
    np.testing.assert_array_equal(sweep.scan.ranges, at_once.scan.ranges)


GLASS_HOUSE = World(
    "glass",
    np.array([[3.0, -50.0, 3.0, 50.0], [6.0, -50.0, 6.0, 50.0], [9.0, -50.0, 9.0, 50.0], [4.0, 2.0, 5.0, 2.0]]),
    glass=np.array([True, True, False, True]),
)


def test_glass_returns_square_beams_and_lets_the_others_through():
    limit = math.radians(10.0)
    angles = np.linspace(-1.2, 1.2, 2001)
    found = measure(lidar(angles, glass_incidence=limit), GLASS_HOUSE)
    # The short pane, met at 60 degrees and more, stops nothing.
    expected = np.where(abs(angles) <= limit, 3.0, 9.0) / np.cos(angles)
    np.testing.assert_allclose(found.scan.ranges, expected, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found.wall_ids, np.where(abs(angles) <= limit, 0, 2))


def test_a_pane_behind_a_pane_returns_what_it_meets_squarely():
    """The first stands oblique, the second square to the beam."""
    world = World(
        "panes",
        np.array([[2.0, -1.0, 4.0, 1.0], [5.0, -1.0, 5.0, 1.0], [8.0, -1.0, 8.0, 1.0]]),
        glass=[True] * 2 + [False],
    )
    found = measure(lidar(np.zeros(5), glass_incidence=0.2), world)
    assert found.scan.ranges.tolist() == [5.0] * 5
    assert found.wall_ids.tolist() == [1] * 5


def test_glass_is_a_wall_unless_asked_otherwise():
    found = measure(lidar(np.linspace(-1.2, 1.2, 100)), GLASS_HOUSE)
    assert set(found.wall_ids) <= {0, 3}


def test_people_are_met_on_their_round_and_where_they_are_then():
    """Every beam on a person ends on its disc as it is then, and the share of them is that of the angle it covers."""
    person = Person([(2.0, 0.0), (2.0, 3.0)], speed=1.0, radius=0.3)
    scanner = lidar(np.linspace(-np.pi, np.pi, BEAMS, endpoint=False), sweep_time=0.1)
    found = measure(scanner, WALL, np.tile(HERE, (BEAMS, 1)), [person], stamp=7.0)
    met = found.person_ids == 0
    ends = found.ranges[:, None] * np.column_stack([np.cos(scanner.angles), np.sin(scanner.angles)])
    centres = person.at(7.0 + scanner.times)
    np.testing.assert_allclose(np.hypot(*(ends - centres)[met].T), 0.3, rtol=0.0, atol=1e-9)
    assert (found.wall_ids[met] == -1).all()
    assert (found.person_ids[found.wall_ids >= 0] == -1).all()
    # One metre a second, there and back: at 7 s it is at (2, 1) on its second way there.
    np.testing.assert_allclose(person.at(np.array([0.0, 2.0, 4.0, 7.0])), [[2, 0], [2, 2], [2, 2], [2, 1]], atol=1e-12)
    np.testing.assert_allclose(met.mean(), 2.0 * math.asin(0.3 / math.sqrt(5.0)) / (2.0 * np.pi), rtol=0.02)


def test_person_equals_shapely():
    person = Person([(1.0, 2.0)], radius=0.4)
    angles = np.linspace(-np.pi, np.pi, 400)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    ranges, cosines = person.cast(np.zeros((400, 2)), directions, np.zeros(400))
    disc = shapely.Point(1.0, 2.0).buffer(0.4, quad_segs=4000)
    rays = shapely.linestrings(np.stack([np.zeros((400, 2)), 9.0 * directions], axis=1))
    expected = shapely.distance(shapely.intersection(rays, disc), shapely.Point(0.0, 0.0))
    met = np.isfinite(ranges)
    np.testing.assert_array_equal(met, ~np.isnan(expected))
    # The polygon's edges lie 0.4 (1 - cos(pi / 16000)) = 8e-9 m inside; grazing beams magnify that.
    square = met & (cosines > 0.1)
    np.testing.assert_allclose(ranges[square], expected[square], rtol=0.0, atol=1e-6)


def test_a_person_around_the_sensor_covers_it():
    found = measure(lidar([0.0, 2.0]), WALL, HERE, [Person([(0.1, 0.0)])])
    assert found.ranges.tolist() == [0.0, 0.0]
    assert found.person_ids.tolist() == [0, 0]


def test_people_fade_as_walls_do():
    """On the middle of the disc, at incidence 0."""
    found = measure(lidar(np.zeros(BEAMS), fade_range=5.0), WALL, HERE, [Person([(3.25, 0.0)])])
    assert (found.person_ids == 0).all()
    assert_share(np.isfinite(found.scan.ranges), math.exp(-((3.0 / 5.0) ** 2)))


def test_labels_name_the_wall_of_each_beam_though_it_is_lost():
    scanner = lidar(np.linspace(-np.pi, np.pi, 920), 0.02, 0.002, lost_share=0.5)
    place = np.array([2.2, 1.7, 0.3])
    found = measure(scanner, room(), place)
    assert (found.wall_ids >= 0).all()
    seen = np.isfinite(found.scan.ranges)
    assert 300 < seen.sum() < 620
    headings = place[2] + scanner.angles[seen]
    points = place[:2] + found.scan.ranges[seen, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    walls = shapely.linestrings(room().walls[found.wall_ids[seen]].reshape(-1, 2, 2))
    # Six sigma of the range, and of the bearing over 9 m.
    assert shapely.distance(walls, shapely.points(points)).max() < 6.0 * math.hypot(0.02, 9.0 * 0.002)


@pytest.mark.parametrize("name", EFFECTS)
def test_presets_measure_a_room(name):
    scanner = Lidar.of_preset(name, effects=EFFECTS[name])
    poses = np.tile([2.2, 1.7, 0.3], (len(scanner.angles), 1))
    found = scanner.measure(room(), poses, 0.0, np.random.default_rng(0))
    error = found.scan.ranges - found.ranges
    assert np.isfinite(error).mean() > 0.9
    assert np.median(abs(error[np.isfinite(error)])) <= 0.02


def test_ideal_scanner_measures_exactly():
    scanner = Lidar.of_preset("ideal")
    scan = scanner.scan(room(), np.array([2.2, 1.7, 0.3]), 0.0, np.random.default_rng(0))
    np.testing.assert_array_equal(scan.ranges, room().cast(np.array([2.2, 1.7, 0.3]), scanner.angles)[0])


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"lost_share": 1.1}, "lost_share is 1.1: expected a number from 0 to 1"),
        ({"range_growth": -0.1}, "range_growth is -0.1"),
        ({"sweep_time": math.nan}, "sweep_time is nan"),
        ({"beam_width": math.inf}, "beam_width is inf"),
        ({"glass_incidence": 2.0}, "glass_incidence is 2: expected a number from 0 to 1.5708"),
        ({"fade_range": 0.0}, "fade_range is 0: expected a positive range"),
        ({"mixed_share": 0.5}, "mixed_share is 0.5, but a beam of beam_width 0 has no edges"),
    ],
)
def test_impossible_effects_are_refused(effects, message):
    with pytest.raises(ValueError, match=message):
        Effects(**effects)


def test_a_sweep_longer_than_a_scan_is_refused():
    with pytest.raises(ValueError, match=r"sweep_time is 0.2 s, but a scan is taken every 0.1 s"):
        lidar([0.0], sweep_time=0.2)


@pytest.mark.parametrize("poses", [np.zeros(2), np.zeros((4, 3))])
def test_poses_that_fit_no_beams_are_refused(poses):
    with pytest.raises(ValueError, match="one for each of 5 beams"):
        measure(lidar(np.zeros(5)), WALL, poses)


@pytest.mark.parametrize(
    ("person", "message"),
    [
        ({"path": np.zeros(2)}, "path of a person"),
        ({"path": [(0.0, math.nan)]}, "path of a person"),
        ({"path": [(0.0, 0.0)], "speed": -1.0}, "speed is -1"),
        ({"path": [(0.0, 0.0)], "radius": 0.0}, "radius is 0"),
    ],
)
def test_impossible_person_is_refused(person, message):
    with pytest.raises(ValueError, match=message):
        Person(**person)
