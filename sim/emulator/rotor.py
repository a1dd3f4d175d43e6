"""The rotating head of a scanner."""

import math

import numpy as np

from features.se2 import Array

LAG = 0.3
"""Time constant with which the speed follows the command [s], assumed: the head spins up within a second or two."""

STABLE = 0.02
"""Relative error of the speed below which the rotation is stable, assumed; it is well above the jitter."""

_WAVES = np.array([0.37, 1.31, 2.83])
"""Frequencies of the jitter per turn: not whole, so that no two turns are the same."""

_SWING = 0.003
"""Largest relative error of the speed by each frequency; together they make an rms of 0.4 %."""


class Rotor:
    """A rotating head whose speed follows the command with a lag, and jitters with the angle.

    Between two commands the angle is a function of time.

    Parameters
    ----------
    rng : source of the first angle and of the phases of the jitter.

    Attributes
    ----------
    wanted : speed that the head approaches [turns/s].
    since : time of the last change of ``wanted`` [s].
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._phases = rng.uniform(0.0, 2.0 * math.pi, len(_WAVES))
        self.since, self._turns, self._speed = 0.0, rng.uniform(), 0.0
        self._commanded = 0.0
        self.wanted = 0.0

    def command(self, speed: float, time: float) -> None:
        """Command a speed [turns/s] from a time on [s], which is not before the last change."""
        self._commanded = speed
        self._change(speed, time)

    def disturb(self, factor: float, time: float) -> None:
        """Change the speed to a multiple of the commanded one from a time on [s]."""
        self._change(factor * self._commanded, time)

    def stop(self, time: float) -> None:
        """Stop the head at once, as without power, at a time [s]."""
        self.command(0.0, time)
        self._speed = 0.0

    def stable_from(self, time: float) -> float:
        """Return when the rotation is stable [s], not before ``time`` [s]; inf while the commanded speed is 0."""
        if self.wanted == 0.0:
            return math.inf
        error = abs(self._speed / self.wanted - 1.0)
        return max(time, self.since + LAG * math.log(max(error / STABLE, 1.0)))

    def turns(self, times: Array) -> Array:
        """Return the clockwise angle, with whole turns counted, shape (n,) [turns], at times of shape (n,) [s]."""
        smooth = self._smooth(times)
        waves = 2.0 * math.pi * _WAVES
        return smooth + (_SWING / waves * np.sin(smooth[:, None] * waves + self._phases)).sum(axis=1)

    def _change(self, speed: float, time: float) -> None:
        if speed != self.wanted:
            self._turns, self._speed = float(self._smooth(np.array([time]))[0]), self._speed_at(time)
            self.since, self.wanted = time, speed

    def _smooth(self, times: Array) -> Array:
        after = times - self.since
        return self._turns + self.wanted * after + (self.wanted - self._speed) * LAG * np.expm1(-after / LAG)

    def _speed_at(self, time: float) -> float:
        return self.wanted + (self._speed - self.wanted) * math.exp((self.since - time) / LAG)
