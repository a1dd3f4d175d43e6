"""Wheel odometry with the errors of the four-parameter motion model, and slip."""

import math
from dataclasses import dataclass, fields

import numpy as np

from features.se2 import Array, wrap_angle

_STILL = 1e-9
"""A step shorter than this is a turn on the spot [m]: its direction is rounding."""


@dataclass(frozen=True, slots=True)
class AlphaOdometry:
    """Odometry with the motion model of Thrun, Burgard and Fox, *Probabilistic Robotics*, table 5.6, and slip.

    A step between two records is a first turn, a translation and a second turn, each with an error of its own ::

        var(turn)        = alpha1 turn^2 + alpha2 translation^2
        var(translation) = alpha3 translation^2 + alpha4 (first turn^2 + second turn^2)

    The variances grow with the square of a step, so that the error of a drive depends on the rate of the records; that
    of :class:`sim.WheelOdometry` does not. A step backwards is a negative translation with small turns.

    Parameters
    ----------
    alpha1 : rotation from rotation [1].
    alpha2 : rotation from translation [rad^2/m^2].
    alpha3 : translation from translation [1].
    alpha4 : translation from rotation [m^2/rad^2].
    slip_rate : mean number of slips of the wheels per metre driven [1/m]; they are a Poisson process.
    slip_length : mean distance that the wheels report too much at a slip [m]; it is exponentially distributed.
    omnidirectional : whether the base drives in any direction: a step is then one translation and one turn, and the
        translation has an error across it of the same variance as along it.

    Raises
    ------
    ValueError
        A parameter is negative or not finite.
    """

    alpha1: float = 0.0
    alpha2: float = 0.0
    alpha3: float = 0.0
    alpha4: float = 0.0
    slip_rate: float = 0.0
    slip_length: float = 0.0
    omnidirectional: bool = False

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} is {value:g}: expected a finite number, not negative")

    def record(self, poses_world_robot: Array, rng: np.random.Generator) -> Array:
        """Return the odometry poses of a true motion; the first one is the true first pose.

        Parameters
        ----------
        poses_world_robot : true poses, shape (n, 3), n >= 1 [m, m, rad]; less than half a turn apart.
        rng : source of the errors.

        Returns
        -------
        Poses in the odometry frame, shape (n, 3), headings in [-pi, pi) [m, m, rad].
        """
        truth = np.asarray(poses_world_robot, dtype=np.float64)
        steps, turns = np.diff(truth[:, :2], axis=0), wrap_angle(np.diff(truth[:, 2]))
        n = len(turns)
        translations = np.hypot(steps[:, 0], steps[:, 1])
        first = np.where(translations > _STILL, wrap_angle(np.arctan2(steps[:, 1], steps[:, 0]) - truth[:-1, 2]), 0.0)
        if not self.omnidirectional:
            backwards = abs(first) > math.pi / 2.0
            first = np.where(backwards, wrap_angle(first + math.pi), first)
            translations = np.where(backwards, -translations, translations)
        # An omnidirectional base need not turn into the direction of its motion.
        parts = np.stack([np.zeros(n), turns]) if self.omnidirectional else np.stack([first, wrap_angle(turns - first)])
        errors = np.sqrt(self.alpha1 * parts**2 + self.alpha2 * translations**2) * rng.standard_normal((2, n))
        if self.omnidirectional:
            errors[0] = 0.0
        sigma_translations = np.sqrt(self.alpha3 * translations**2 + self.alpha4 * (parts**2).sum(axis=0))
        slip_counts = rng.poisson(self.slip_rate * abs(translations))
        slips = self.slip_length * np.sign(translations) * rng.standard_gamma(slip_counts)
        odom_translations = translations + sigma_translations * rng.standard_normal(n) + slips
        asides = sigma_translations * rng.standard_normal(n) if self.omnidirectional else np.zeros(n)
        headings: Array = truth[0, 2] + np.concatenate([[0.0], np.cumsum(turns + errors.sum(axis=0))])
        along = headings[:-1] + first + errors[0]
        c, s = np.cos(along), np.sin(along)
        odom_steps = np.column_stack([c * odom_translations - s * asides, s * odom_translations + c * asides])
        positions = truth[0, :2] + np.vstack([np.zeros(2), np.cumsum(odom_steps, axis=0)])
        return np.column_stack([positions, wrap_angle(headings)])
