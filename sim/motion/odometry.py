"""Wheel odometry of a true motion, whose errors do not depend on the rate of the records."""

import math
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from features.se2 import Array, wrap_angle


class Odometry(Protocol):
    """A model of odometry: it makes odometry poses of a true motion."""

    def record(self, poses_world_robot: Array, rng: np.random.Generator) -> Array:
        """Return the odometry of true poses, both of shape (n, 3) [m, m, rad]; the first pose is the true one."""
        ...


@dataclass(frozen=True, slots=True)
class WheelOdometry:
    """Odometry of a differential drive with random and systematic errors.

    Each random error is a random walk: its variance grows linearly with the distance driven and the angle turned, so
    that the error of a drive does not depend on the length of its steps. For a step of length d [m] and turn phi [rad],
    the variances are ::

        var(d)   = sigma_distance_per_metre^2 |d| + sigma_distance_per_radian^2 |phi|
        var(phi) = sigma_turn_per_radian^2 |phi|  + sigma_turn_per_metre^2 |d|

    Parameters
    ----------
    sigma_turn_per_radian : rotation from rotation [rad/sqrt(rad)].
    sigma_turn_per_metre : rotation from translation [rad/sqrt(m)].
    sigma_distance_per_metre : translation from translation [m/sqrt(m)].
    sigma_distance_per_radian : translation from rotation [m/sqrt(rad)].
    scale_left, scale_right : distance that each wheel reports per distance that it rolls; 1 is exact.
    wheel_base : true distance between the wheels [m].
    base_factor : ratio of the wheel base that the odometry assumes to the true one; 1 is exact.

    Raises
    ------
    ValueError
        A sigma is negative, or a factor or the wheel base is not positive.
    """

    sigma_turn_per_radian: float = 0.0
    sigma_turn_per_metre: float = 0.0
    sigma_distance_per_metre: float = 0.0
    sigma_distance_per_radian: float = 0.0
    scale_left: float = 1.0
    scale_right: float = 1.0
    wheel_base: float = 0.3
    base_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in (f.name for f in fields(self)):
            value = getattr(self, name)
            if name.startswith("sigma_"):
                if not (math.isfinite(value) and value >= 0.0):
                    raise ValueError(f"{name} is {value:g}: expected a finite number, not negative")
            elif not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value:g}: expected a positive, finite number")

    def record(self, poses_world_robot: Array, rng: np.random.Generator) -> Array:
        """Return the odometry poses of a true motion; the first one is the true first pose.

        Parameters
        ----------
        poses_world_robot : true poses, shape (n, 3), n >= 1 [m, m, rad]; less than half a turn apart.
        rng : source of the random errors.

        Returns
        -------
        Poses in the odometry frame, shape (n, 3), headings in [-pi, pi) [m, m, rad].
        """
        truth = np.asarray(poses_world_robot, dtype=np.float64)
        steps = np.diff(truth[:, :2], axis=0)
        turns = wrap_angle(np.diff(truth[:, 2]))
        middles = truth[:-1, 2] + turns / 2.0
        ahead = np.cos(middles) * steps[:, 0] + np.sin(middles) * steps[:, 1]
        aside = -np.sin(middles) * steps[:, 0] + np.cos(middles) * steps[:, 1]
        # The wheels roll along the arc; the poses give its chord.
        chord_per_arc = np.sinc(turns / (2.0 * math.pi))
        distances, odom_turns = self._systematic(ahead / chord_per_arc, turns)
        variance_distance = self.sigma_distance_per_metre**2 * abs(distances) + self.sigma_distance_per_radian**2 * abs(
            turns
        )
        variance_turn = self.sigma_turn_per_radian**2 * abs(turns) + self.sigma_turn_per_metre**2 * abs(distances)
        distances = distances + np.sqrt(variance_distance) * rng.standard_normal(len(distances))
        odom_turns = odom_turns + np.sqrt(variance_turn) * rng.standard_normal(len(distances))
        headings: Array = truth[0, 2] + np.concatenate([[0.0], np.cumsum(odom_turns)])
        odom_middles = headings[:-1] + odom_turns / 2.0
        chords = distances * np.sinc(odom_turns / (2.0 * math.pi))
        c, s = np.cos(odom_middles), np.sin(odom_middles)
        odom_steps = np.column_stack([c * chords - s * aside, s * chords + c * aside])
        positions = truth[0, :2] + np.vstack([np.zeros(2), np.cumsum(odom_steps, axis=0)])
        return np.column_stack([positions, wrap_angle(headings)])

    def _systematic(self, distances: Array, turns: Array) -> tuple[Array, Array]:
        """Apply the systematic errors to distances [m] and turns [rad], shape (n,) each."""
        half = self.wheel_base * turns / 2.0
        left, right = self.scale_left * (distances - half), self.scale_right * (distances + half)
        return (left + right) / 2.0, (right - left) / (self.wheel_base * self.base_factor)
