"""Robots that drive from waypoint to waypoint: a differential drive, and an omnidirectional base."""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from features.se2 import Array, wrap_angle
from sim.motion.true_trajectory import TrueTrajectory


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the motion of a robot; the defaults are those of a small indoor robot.

    Parameters
    ----------
    speed : largest speed [m/s].
    acceleration : largest change of the velocity [m/s^2].
    turn_rate : largest turn rate [rad/s].
    turn_acceleration : largest change of the turn rate [rad/s^2].
    reach : a waypoint counts as reached when the robot is nearer than this [m].

    Raises
    ------
    ValueError
        A limit is not positive.
    """

    speed: float = 0.5
    acceleration: float = 0.5
    turn_rate: float = 1.0
    turn_acceleration: float = 3.0
    reach: float = 0.15

    def __post_init__(self) -> None:
        for limit in fields(self):
            value = getattr(self, limit.name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{limit.name} is {value:g}: a limit must be positive and finite")


@dataclass(frozen=True, slots=True)
class Robot(MotionLimits):
    """A robot with a differential drive; it never drives backwards."""

    def drive(self, waypoints: npt.ArrayLike, rate: float) -> TrueTrajectory:
        """Drive through all waypoints and stop within reach of the last.

        The robot starts at the first waypoint, at rest and facing the second. It turns towards the next waypoint while
        it drives, and drives the more slowly, the larger its heading error is.

        Parameters
        ----------
        waypoints : shape (n, 2), n >= 2, each farther than ``reach`` from the one before, world frame [m].
        rate : steps, and poses, per second [Hz].

        Raises
        ------
        ValueError
            There are fewer than two waypoints, two in a row are nearer than ``reach``, or the rate is not positive.
        """
        points = np.asarray(waypoints, dtype=np.float64)
        if points.shape[1:] != (2,):
            raise ValueError(f"expected at least two finite waypoints of shape (n, 2), got shape {points.shape}")
        _check_waypoints(points, self.reach, rate)
        return TrueTrajectory(rate, np.array(self._steps(points.tolist(), 1.0 / rate)))

    def _steps(self, points: list[list[float]], dt: float) -> list[tuple[float, float, float]]:
        """Return the poses [m, m, rad], one every ``dt`` [s], from the first point to a stop at the last."""
        x, y = points[0]
        heading = math.atan2(points[1][1] - y, points[1][0] - x)
        speed = turn_rate = 0.0
        poses = [(x, y, wrap_angle(heading))]
        for index, (goal_x, goal_y) in enumerate(points[1:], start=1):
            last = index == len(points) - 1
            while (distance := math.hypot(goal_x - x, goal_y - y)) > self.reach:
                stop = distance - self.reach if last else math.inf
                error = wrap_angle(math.atan2(goal_y - y, goal_x - x) - heading)
                speed, turn_rate = self._accelerate(speed, turn_rate, stop, error, dt)
                turn = turn_rate * dt
                step = speed * dt * float(np.sinc(turn / (2.0 * math.pi)))
                x += step * math.cos(heading + turn / 2.0)
                y += step * math.sin(heading + turn / 2.0)
                heading += turn
                poses.append((x, y, wrap_angle(heading)))
        return poses

    def _accelerate(self, speed: float, turn_rate: float, stop: float, error: float, dt: float) -> tuple[float, float]:
        """Return the speed [m/s] and turn rate [rad/s] of the next step, as near to those wanted as the limits allow.

        ``stop`` is the distance in which to come to rest [m], ``error`` the heading error towards the waypoint [rad].
        """
        wanted_speed = min(self.speed * max(0.0, math.cos(error)), _braking_speed(self.acceleration, stop))
        change = self.acceleration * dt
        return speed + min(max(wanted_speed - speed, -change), change), _turn_towards(self, turn_rate, error, dt)


@dataclass(frozen=True, slots=True)
class OmniRobot(MotionLimits):
    """An omnidirectional base: the same limits hold in every direction, and it turns independently of its motion."""

    def drive(self, waypoints: npt.ArrayLike, rate: float) -> TrueTrajectory:
        """Drive through all waypoints and stop within reach of the last.

        The robot starts at the first waypoint, at rest. On its way to a waypoint it turns to the heading of that
        waypoint; where the distance is too short for the turn, it drives on with the heading that it has reached.

        Parameters
        ----------
        waypoints : shape (n, 3), n >= 2, each farther than ``reach`` from the one before, world frame [m, m, rad].
        rate : steps, and poses, per second [Hz].

        Raises
        ------
        ValueError
            There are fewer than two waypoints, two in a row are nearer than ``reach``, or the rate is not positive.
        """
        points = np.asarray(waypoints, dtype=np.float64)
        if points.shape[1:] != (3,):
            raise ValueError(f"expected at least two finite waypoints of shape (n, 3), got shape {points.shape}")
        _check_waypoints(points, self.reach, rate)
        return TrueTrajectory(rate, np.array(self._steps(points.tolist(), 1.0 / rate)))

    def _steps(self, points: list[list[float]], dt: float) -> list[tuple[float, float, float]]:
        """Return the poses [m, m, rad], one every ``dt`` [s], from the first point to a stop at the last."""
        x, y, heading = points[0]
        vx = vy = turn_rate = 0.0
        poses = [(x, y, wrap_angle(heading))]
        for index, (goal_x, goal_y, goal_heading) in enumerate(points[1:], start=1):
            last = index == len(points) - 1
            while (distance := math.hypot(goal_x - x, goal_y - y)) > self.reach:
                stop = distance - self.reach if last else math.inf
                wanted = min(self.speed, _braking_speed(self.acceleration, stop)) / distance
                change_x, change_y = wanted * (goal_x - x) - vx, wanted * (goal_y - y) - vy
                share = min(1.0, self.acceleration * dt / max(math.hypot(change_x, change_y), 1e-12))
                vx, vy = vx + share * change_x, vy + share * change_y
                turn_rate = _turn_towards(self, turn_rate, wrap_angle(goal_heading - heading), dt)
                x, y, heading = x + vx * dt, y + vy * dt, heading + turn_rate * dt
                poses.append((x, y, wrap_angle(heading)))
        return poses


def _check_waypoints(points: Array, reach: float, rate: float) -> None:
    if len(points) < 2 or not np.isfinite(points).all():
        raise ValueError(f"expected at least two finite waypoints, got shape {points.shape}")
    legs = np.hypot(*np.diff(points[:, :2], axis=0).T)
    if (legs <= reach).any():
        near = int((legs <= reach).argmax())
        raise ValueError(f"waypoints {near} and {near + 1} are {legs[near]:g} m apart: expected more than the reach")
    if not (math.isfinite(rate) and rate > 0.0):
        raise ValueError(f"rate is {rate:g}: expected poses per second")


def _braking_speed(acceleration: float, stop: float) -> float:
    """Return the speed [m/s] from which the robot comes to rest within ``stop`` [m].

    It assumes four fifths of the largest deceleration, which leaves a margin for discrete steps.
    """
    return math.sqrt(1.6 * acceleration * stop)


def _turn_towards(limits: MotionLimits, turn_rate: float, error: float, dt: float) -> float:
    """Return the turn rate of the next step [rad/s], which reduces a heading error [rad] without overshoot.

    It is at most half of the rate from which the limit stops the turn in time, which leaves a margin for discrete
    steps, and at most 4 /s of the error, so that small errors decay smoothly, with a time constant of 0.25 s.
    """
    braking = math.sqrt(2.0 * limits.turn_acceleration * abs(error))
    wanted = math.copysign(min(limits.turn_rate, 0.5 * braking, 4.0 * abs(error)), error)
    change = limits.turn_acceleration * dt
    return turn_rate + min(max(wanted - turn_rate, -change), change)
