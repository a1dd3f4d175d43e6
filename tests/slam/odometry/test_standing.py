"""Standing still, recognised by the scans alone, and a slow motion that is not taken for it."""

import dataclasses
import math

import numpy as np
import pytest
from places import DATA

from drivers.frame import Frame
from drivers.open_log import open_log
from features.scan import LaserScan
from features.se2 import compose, pose, wrap_angle
from features.sensor import Mounting, sensor_preset
from sim import Effects, Lidar, room
from sim.sensing.effects import EFFECTS
from slam.config import SlamConfig
from slam.config_file import load_config
from slam.odometry.rules import StandRules
from slam.odometry.standing import StandDetector
from slam.pipeline import Slam

ROOM = room()
RULES = StandRules()
IDEAL, CENTRE = Effects(), Mounting()


def drive(speed, turn_rate, count, *, effects=IDEAL, mounting=CENTRE, seed=0):
    """Scans and true poses of a robot of steady speed, ten a second."""
    rng = np.random.default_rng(seed)
    scanner = dataclasses.replace(Lidar.of_preset("rplidar-s1", mounting, effects))
    scanner = dataclasses.replace(scanner, angles=scanner.angles[::3])
    for k in range(count):
        times = 0.1 * k + (scanner.times if effects.sweep_time > 0.0 else np.zeros(len(scanner.angles)))
        heading = 0.3 + turn_rate * times
        poses = np.column_stack([2.2 + speed * times * math.cos(0.3), 1.7 + speed * times * math.sin(0.3), heading])
        swept = poses if effects.sweep_time > 0.0 else poses[-1]
        yield scanner.measure(ROOM, swept, 0.1 * k, rng).scan, poses[len(poses) // 2]


@pytest.mark.slow
@pytest.mark.parametrize("effects", [Effects(), EFFECTS["rplidar-s1"]], ids=["noise", "effects"])
@pytest.mark.parametrize("mounting", [Mounting(), Mounting(0.2, -0.1, 0.6), Mounting(0.1, 0.1, -0.7, upside_down=True)])
def test_a_robot_that_stands_is_found_to_stand_and_stays_so(effects, mounting):
    detector = StandDetector(sensor_preset("rplidar-s1"), RULES)
    stood = []
    for scan, _ in drive(0.0, 0.0, 4 * RULES.scans, effects=effects, mounting=mounting):
        detector.add(scan)
        stood.append(detector.standing)
    assert stood == [k >= RULES.scans for k in range(4 * RULES.scans)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "turn_rate"), [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.05, 0.0), (0.0, 0.1), (0.2, 0.1), (0.5, 1.0)]
)
def test_a_slow_motion_is_not_frozen(speed, turn_rate):
    """At a centimetre a second the pose lags by less than two; when it is fast it is as good as the scans."""
    config = SlamConfig.of_preset("rplidar-s1")
    slam = Slam(config.model_copy(update={"odometry": config.odometry.model_copy(update={"source": "lines"})}))
    off = []
    first = None
    for scan, truth in drive(speed, turn_rate, 150):
        first = truth if first is None else first
        step = slam.process(Frame(scan.stamp, pose(), scan))
        moved = truth - first
        c, s = math.cos(0.3), math.sin(0.3)
        expected = [c * moved[0] + s * moved[1], -s * moved[0] + c * moved[1], moved[2]]
        difference = step.pose_world_robot - expected
        off.append(np.abs([*difference[:2], wrap_angle(float(difference[2]))]))
    worst = np.max(off, axis=0)
    assert worst[:2].max() < (0.02 if abs(speed) < 0.1 else 0.05)
    assert worst[2] < math.radians(0.6 if abs(turn_rate) < 0.5 else 2.0)


@pytest.mark.parametrize("mounting", [Mounting(), Mounting(0.2, -0.1, 0.6), Mounting(0.1, 0.1, -0.7, upside_down=True)])
def test_the_displacement_is_that_of_the_robot(mounting):
    angles = np.linspace(-math.pi, math.pi, 600, endpoint=False)
    model = dataclasses.replace(sensor_preset("rplidar-s1"), mounting=mounting)
    rng, detector, moved, here = (
        np.random.default_rng(0),
        StandDetector(model, RULES),
        pose(0.01, -0.015, 0.005),
        pose(2.2, 1.7),
    )
    casts = -angles if mounting.upside_down else angles
    for k in range(12):
        place = here if k == 0 else compose(here, moved)
        ranges = ROOM.cast(compose(place, mounting.pose_robot_sensor), casts)[0]
        detector.add(LaserScan(ranges + rng.normal(0.0, 1e-3, 600), angles))
    np.testing.assert_allclose(detector.moved, moved, atol=2e-3)


def test_scans_without_returns_and_scans_alike_to_the_last_digit_do_no_harm():
    detector = StandDetector(sensor_preset("rplidar-s1"), RULES)
    angles = np.linspace(-math.pi, math.pi, 300, endpoint=False)
    nothing = LaserScan(np.full(300, math.inf), angles)
    alike = LaserScan(ROOM.cast(pose(2.2, 1.7, 0.3), angles)[0], angles)
    for scan in [nothing, nothing, *[alike] * (RULES.scans + 2)]:
        detector.add(scan)
    assert detector.standing
    detector.add(nothing)
    detector.add(LaserScan(np.empty(0), np.empty(0)))
    assert not detector.standing


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "lidar-standing.bag").exists(), reason="no test data")
def test_a_real_scanner_in_front_of_one_wall_does_not_drift():
    source = open_log(DATA / "lidar-standing.bag")
    slam = Slam(load_config(None, source=source.info))
    for frame in source:
        slam.process(frame)
    places = slam.finish().trajectory.poses[:, :2]
    assert np.hypot(*(places - places[0]).T).max() < 0.03
