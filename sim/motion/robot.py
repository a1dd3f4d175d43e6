"""Robots that drive from waypoint to waypoint: with a differential drive, and in any direction."""

import math
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from features.se2 import Array, wrap_angle


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """True poses at a fixed rate, from time zero.

    Parameters
    ----------
    rate : poses per second [Hz].
    poses_world_robot : shape (n, 3), headings in [-pi, pi) [m, m, rad].
    """

    rate: float
    poses_world_robot: Array

    @property
    def stamps(self) -> Array:
        """Time of each pose, shape (n,) [s]."""
        return np.arange(len(self.poses_world_robot)) / self.rate

    def at(self, times: Array) -> Array:
        """Poses at times of shape (n,) [s], shape (n, 3) [m, m, rad]: on the straight line between the two beside it.

        Before the first pose and after the last the robot stands.
        """
        last = len(self.poses_world_robot) - 1
        places = np.clip(np.asarray(times) * self.rate, 0, last)
        before = places.astype(np.int64)
        starts, ends = self.poses_world_robot[before], self.poses_world_robot[np.minimum(before + 1, last)]
        steps = ends - starts
        steps[:, 2] = wrap_angle(steps[:, 2])
        poses = starts + (places - before)[:, None] * steps
        poses[:, 2] = wrap_angle(poses[:, 2])
        return poses


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the motion of a robot.

    Parameters
    ----------
    speed : largest speed [m/s].
    acceleration : largest change of the velocity [m/s^2].
    turn_rate : largest turn rate [rad/s].
    turn_acceleration : largest change of the turn rate [rad/s^2].
    reach : a waypoint nearer than this has been reached [m].

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
    """A differential drive; it never drives backwards."""

    def drive(self, waypoints: npt.ArrayLike, rate: float) -> Trajectory:
        """Drive through all waypoints and stop within reach of the last.

        The robot starts on the first one, at rest and facing the second. It turns towards its waypoint as it goes,
        slower the more it looks away from it.

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
        return Trajectory(rate, np.array(self._steps(points.tolist(), 1.0 / rate)))

    def _steps(self, points: list[list[float]], dt: float) -> list[tuple[float, float, float]]:
        """Poses [m, m, rad] every ``dt`` [s] from the first point to a stop at the last."""
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
        """Speed [m/s] and turn rate [rad/s] of the next step, as near to the wanted ones as the limits let them be.

        ``stop`` is the distance in which to come to rest [m], ``error`` the direction of the waypoint ahead [rad].
        """
        wanted_speed = min(self.speed * max(0.0, math.cos(error)), _braking_speed(self.acceleration, stop))
        change = self.acceleration * dt
        return speed + min(max(wanted_speed - speed, -change), change), _turn_towards(self, turn_rate, error, dt)


@dataclass(frozen=True, slots=True)
class OmniRobot(MotionLimits):
    """A base that drives in any direction, with its velocity limited in any, and turns as it likes."""

    def drive(self, waypoints: npt.ArrayLike, rate: float) -> Trajectory:
        """Drive through all waypoints and stop within reach of the last.

        The robot starts on the first one, at rest. On its way to a waypoint it turns to the heading given with it,
        independently of where it drives; where the way is too short for that, it goes on as it has come.

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
        return Trajectory(rate, np.array(self._steps(points.tolist(), 1.0 / rate)))

    def _steps(self, points: list[list[float]], dt: float) -> list[tuple[float, float, float]]:
        """Poses [m, m, rad] every ``dt`` [s] from the first point to a stop at the last."""
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
    """Speed [m/s] from which to come to rest in ``stop`` [m].

    It takes four fifths of what the limit allows, so that the step behind is made up for.
    """
    return math.sqrt(1.6 * acceleration * stop)


def _turn_towards(limits: MotionLimits, turn_rate: float, error: float, dt: float) -> float:
    """Turn rate of the next step [rad/s], to make a heading error of ``error`` vanish without going past it."""
    braking = math.sqrt(2.0 * limits.turn_acceleration * abs(error))
    wanted = math.copysign(min(limits.turn_rate, 0.5 * braking, 4.0 * abs(error)), error)
    change = limits.turn_acceleration * dt
    return turn_rate + min(max(wanted - turn_rate, -change), change)
