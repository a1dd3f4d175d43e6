"""The true motion: limits kept, waypoints reached, the same every time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from features.se2 import wrap_angle
from sim import Robot, room_waypoints

RATE = 50.0


def speeds(poses):
    """Speed [m/s] along the chord and turn rate [rad/s] of each step."""
    return np.hypot(*np.diff(poses[:, :2], axis=0).T) * RATE, wrap_angle(np.diff(poses[:, 2])) * RATE


def assert_keeps_limits(robot, poses):
    """Slack: 1e-9 for rounding; a chord is shorter than its arc by turn^2 / 24, which shows as acceleration."""
    speed, turn_rate = speeds(poses)
    arc = speed / np.sinc(turn_rate / RATE / (2.0 * math.pi))
    assert arc.max() <= robot.speed + 1e-9
    assert abs(np.diff(arc, prepend=0.0)).max() * RATE <= robot.acceleration + 1e-6
    assert abs(turn_rate).max() <= robot.turn_rate + 1e-9
    assert abs(np.diff(turn_rate, prepend=0.0)).max() * RATE <= robot.turn_acceleration + 1e-6


def assert_reaches_in_order(robot, poses, waypoints):
    first = 0
    for waypoint in waypoints:
        near = np.hypot(*(poses[first:, :2] - waypoint).T) <= robot.reach
        assert near.any(), f"waypoint {waypoint} was not reached"
        first += int(near.argmax())


def test_room_path_keeps_limits_and_reaches_its_waypoints():
    robot = Robot()
    poses = robot.drive(room_waypoints(), RATE).poses_world_robot
    assert_keeps_limits(robot, poses)
    assert_reaches_in_order(robot, poses, room_waypoints())


@given(
    seed=st.integers(0, 2**32 - 1),
    speed=st.floats(0.2, 2.0),
    acceleration=st.floats(0.2, 2.0),
    turn_rate=st.floats(0.3, 3.0),
    turn_acceleration=st.floats(1.0, 10.0),
)
@settings(derandomize=True, deadline=None, max_examples=30)
def test_any_robot_keeps_its_limits_and_arrives(seed, speed, acceleration, turn_rate, turn_acceleration):
    """Waypoints 0.3 to 3 m apart in any direction, turns on the spot among them."""
    rng = np.random.default_rng(seed)
    robot = Robot(speed, acceleration, turn_rate, turn_acceleration)
    directions, lengths = rng.uniform(-np.pi, np.pi, 5), rng.uniform(0.3, 3.0, 5)
    legs = lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    waypoints = np.vstack([np.zeros(2), np.cumsum(legs, axis=0)])
    poses = robot.drive(waypoints, RATE).poses_world_robot
    assert_keeps_limits(robot, poses)
    assert_reaches_in_order(robot, poses, waypoints)


def test_motion_is_that_of_a_differential_drive():
    """No step goes sideways or backwards: its chord looks along the middle heading."""
    poses = Robot().drive(room_waypoints(), RATE).poses_world_robot
    steps, turns = np.diff(poses[:, :2], axis=0), wrap_angle(np.diff(poses[:, 2]))
    middles = poses[:-1, 2] + turns / 2.0
    assert abs(np.cos(middles) * steps[:, 1] - np.sin(middles) * steps[:, 0]).max() < 1e-12
    assert (np.cos(middles) * steps[:, 0] + np.sin(middles) * steps[:, 1]).min() > -1e-12


def test_starts_at_the_first_waypoint_and_stops_at_the_last():
    """It faces the second waypoint, and within reach of the last hardly moves."""
    poses = Robot().drive([(1.0, 2.0), (1.0, 4.0)], RATE).poses_world_robot
    np.testing.assert_allclose(poses[0], [1.0, 2.0, math.pi / 2.0])
    speed, _ = speeds(poses)
    assert speed.max() == pytest.approx(0.5)
    assert speed[-1] < 0.05
    assert np.hypot(*(poses[-1, :2] - [1.0, 4.0])) <= 0.15


def test_stamps_follow_the_rate():
    trajectory = Robot().drive([(0.0, 0.0), (2.0, 0.0)], 20.0)
    assert trajectory.stamps.shape == (len(trajectory.poses_world_robot),)
    np.testing.assert_allclose(np.diff(trajectory.stamps), 0.05)
    assert trajectory.stamps[0] == 0.0


def test_same_drive_gives_the_same_bytes():
    first, second = (Robot().drive(room_waypoints(), RATE).poses_world_robot for _ in range(2))
    assert first.tobytes() == second.tobytes()


@pytest.mark.parametrize(
    ("waypoints", "rate", "message"),
    [
        ([(0.0, 0.0)], RATE, "at least two"),
        ([(0.0, 0.0), (math.nan, 0.0)], RATE, "finite"),
        ([(0.0, 0.0), (1.0, 0.0), (1.0, 0.1)], RATE, "waypoints 1 and 2 are 0.1 m apart"),
        ([(0.0, 0.0), (1.0, 0.0)], 0.0, "rate is 0"),
    ],
)
def test_impossible_drive_is_refused(waypoints, rate, message):
    with pytest.raises(ValueError, match=message):
        Robot().drive(waypoints, rate)


def test_impossible_limit_is_refused():
    with pytest.raises(ValueError, match="turn_rate is 0"):
        Robot(turn_rate=0.0)
