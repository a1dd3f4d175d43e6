"""A base that drives in any direction: limits kept, waypoints reached, headings taken up on the way."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from features.se2 import wrap_angle
from sim import OmniRobot

RATE = 50.0


@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.floats(0.2, 2.0),
    acceleration=st.floats(0.2, 2.0),
    turn_rate=st.floats(0.3, 3.0),
    turn_acceleration=st.floats(1.0, 10.0),
)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_any_base_keeps_its_limits_and_arrives(seed, speed, acceleration, turn_rate, turn_acceleration):
    """Waypoints 0.3 to 3 m apart in any direction, with any heading. Slack 1e-6: rounding, divided by a step twice."""
    rng = np.random.default_rng(seed)
    robot = OmniRobot(speed, acceleration, turn_rate, turn_acceleration)
    directions, lengths = rng.uniform(-np.pi, np.pi, 5), rng.uniform(0.3, 3.0, 5)
    legs = lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    points = np.vstack([np.zeros(2), np.cumsum(legs, axis=0)])
    poses = robot.drive(np.column_stack([points, rng.uniform(-9.0, 9.0, 6)]), RATE).poses_world_robot
    velocities = np.diff(poses[:, :2], axis=0, prepend=poses[:1, :2]) * RATE
    turns = wrap_angle(np.diff(poses[:, 2], prepend=poses[0, 2])) * RATE
    assert np.hypot(*velocities.T).max() <= speed + 1e-6
    assert np.hypot(*np.diff(velocities, axis=0).T).max() * RATE <= acceleration + 1e-6
    assert abs(turns).max() <= turn_rate + 1e-6
    assert abs(np.diff(turns)).max() * RATE <= turn_acceleration + 1e-6
    first = 0
    for point in points:
        near = np.hypot(*(poses[first:, :2] - point).T) <= robot.reach
        assert near.any()
        first += int(near.argmax())


def test_it_drives_sideways_and_backwards_with_its_heading_kept():
    poses = OmniRobot().drive([(0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (0.0, 0.0, 1.0)], RATE).poses_world_robot
    np.testing.assert_allclose(poses[:, 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(poses[:, 2], 1.0, atol=1e-12)
    assert poses[:, 0].max() > 1.8


def test_it_turns_to_the_heading_of_each_waypoint_and_stops_at_the_last():
    poses = OmniRobot().drive([(0.0, 0.0, 0.0), (3.0, 0.0, 2.5), (3.0, 3.0, -2.5)], RATE).poses_world_robot
    at_second = int((np.hypot(*(poses[:, :2] - [3.0, 0.0]).T) <= 0.15).argmax())
    assert poses[at_second, 2] == pytest.approx(2.5, abs=1e-3)
    assert poses[-1, 2] == pytest.approx(-2.5, abs=1e-3)
    # The short way, across half a turn.
    assert abs(poses[at_second:, 2]).min() > 2.4
    assert np.hypot(*(poses[-1] - poses[-2])[:2]) * RATE < 0.05


def test_same_drive_gives_the_same_bytes():
    path = [(0.0, 0.0, 0.0), (3.0, 0.0, 2.5), (3.0, 3.0, -2.5)]
    first, second = (OmniRobot().drive(path, RATE).poses_world_robot.tobytes() for _ in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("waypoints", "rate", "message"),
    [
        ([(0.0, 0.0), (1.0, 0.0)], RATE, r"waypoints of shape \(n, 3\)"),
        ([(0.0, 0.0, 0.0)], RATE, "at least two"),
        ([(0.0, 0.0, 0.0), (1.0, 0.0, math.inf)], RATE, "finite"),
        ([(0.0, 0.0, 0.0), (0.1, 0.0, 2.0)], RATE, "waypoints 0 and 1 are 0.1 m apart"),
        ([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)], math.nan, "rate is nan"),
    ],
)
def test_impossible_drive_is_refused(waypoints, rate, message):
    with pytest.raises(ValueError, match=message):
        OmniRobot().drive(waypoints, rate)


def test_impossible_limit_is_refused():
    with pytest.raises(ValueError, match="acceleration is -1"):
        OmniRobot(acceleration=-1.0)
