"""The turning head of a scanner."""

import math

import numpy as np

from features.se2 import Array

LAG = 0.3
"""Time constant with which the speed follows what is wanted [s]."""

STABLE = 0.02
"""The rotation is stable when its speed is as near as this to what is wanted, relatively."""

_WAVES = np.array([0.37, 1.31, 2.83])
"""Periods of the jitter in a turn."""

_SWING = 0.003
"""Largest relative error of the speed that each of them makes."""


class Rotor:
    """Angle of a head whose speed follows the wanted one with a lag and jitters with the angle.

    Between two commands the angle is a function of time.

    Parameters
    ----------
    rng : source of the first angle and of the jitter's phases.

    Attributes
    ----------
    wanted : speed that it goes to [turns/s].
    since : when that was changed last [s].
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._phases = rng.uniform(0.0, 2.0 * math.pi, len(_WAVES))
        self.since, self._turns, self._speed = 0.0, rng.uniform(), 0.0
        self._commanded = 0.0
        self.wanted = 0.0

    def command(self, speed: float, time: float) -> None:
        """Want a speed [turns/s] from a time on [s], which is not before that of the last change."""
        self._commanded = speed
        self._change(speed, time)

    def disturb(self, factor: float, time: float) -> None:
        """Turn faster or slower than commanded, by a factor."""
        self._change(factor * self._commanded, time)

    def stop(self, time: float) -> None:
        """Stand still at once, as without power."""
        self.command(0.0, time)
        self._speed = 0.0

    def stable_from(self, time: float) -> float:
        """When the rotation is stable, at the earliest at ``time`` [s]; inf while it is to stand."""
        if self.wanted == 0.0:
            return math.inf
        error = abs(self._speed / self.wanted - 1.0)
        return max(time, self.since + LAG * math.log(max(error / STABLE, 1.0)))

    def turns(self, times: Array) -> Array:
        """Angle at times of shape (n,) [s], clockwise, counted on over whole turns, shape (n,) [turns]."""
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
