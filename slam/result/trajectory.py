"""Trajectories: poses over time, looked up by stamp."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import minimum_filter1d

from features.se2 import Array, wrap_angle

STAMPS_ABOUT = 101
"""Number of different stamps around one from which the tick of the clock there is estimated."""


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses of the robot in one frame, in the order of their stamps.

    Parameters
    ----------
    stamps : shape (n,) [s], never decreasing.
    poses : shape (n, 3) [m, m, rad].

    Raises
    ------
    ValueError
        Shapes do not fit, a value is not finite, or a stamp is smaller than the one before.
    """

    stamps: Array
    poses: Array

    def __post_init__(self) -> None:
        stamps = np.ascontiguousarray(self.stamps, dtype=np.float64)
        poses = np.ascontiguousarray(self.poses, dtype=np.float64)
        if stamps.ndim != 1 or poses.shape != (stamps.size, 3):
            raise ValueError(f"stamps {stamps.shape} and poses {poses.shape}: expected shapes (n,) and (n, 3)")
        if not (np.isfinite(stamps).all() and np.isfinite(poses).all()):
            raise ValueError("a stamp or pose is not finite: expected seconds, metres and radians")
        backward = np.diff(stamps) < 0.0
        if backward.any():
            index = int(backward.argmax()) + 1
            raise ValueError(f"stamp {index} is smaller than the one before: expected stamps in order")
        object.__setattr__(self, "stamps", stamps)
        object.__setattr__(self, "poses", poses)

    def __len__(self) -> int:
        return self.stamps.size

    def at(self, stamps: ArrayLike, tolerance: float = 1e-6) -> Array:
        """Interpolate the poses linearly in position and the shorter way round in heading.

        Parameters
        ----------
        stamps : shape (k,) [s].
        tolerance : a stamp outside the trajectory by no more than this takes the pose of its end [s]. By default the
            resolution of a TUM file.

        Returns
        -------
        poses : shape (k, 3) [m, m, rad], headings in [-pi, pi).

        Raises
        ------
        ValueError
            A stamp is outside the trajectory by more than the tolerance, or is not finite; the trajectory is empty.
        """
        wanted = _stamp_array(stamps)
        if len(self) == 0:
            raise ValueError("an empty trajectory has no poses to interpolate")
        outside = ~((wanted >= self.stamps[0] - tolerance) & (wanted <= self.stamps[-1] + tolerance))
        if outside.any():
            raise ValueError(
                f"stamp {wanted[outside.argmax()]:.6f} is outside the trajectory, which lasts from "
                f"{self.stamps[0]:.6f} to {self.stamps[-1]:.6f}, by more than {tolerance:g} s"
            )
        after = np.clip(np.searchsorted(self.stamps, wanted), 1, max(len(self) - 1, 1))
        before, after = after - 1, np.minimum(after, len(self) - 1)
        duration = self.stamps[after] - self.stamps[before]
        elapsed = wanted - self.stamps[before]
        weight = np.clip(np.divide(elapsed, duration, out=np.zeros_like(wanted), where=duration > 0.0), 0.0, 1.0)
        step = self.poses[after] - self.poses[before]
        step[:, 2] = wrap_angle(step[:, 2])
        poses = self.poses[before] + weight[:, np.newaxis] * step
        poses[:, 2] = wrap_angle(poses[:, 2])
        return poses

    def nearest(self, stamps: ArrayLike, tolerance: float) -> NDArray[np.intp]:
        """Look up the pose nearest in time, of two equally near stamps the earlier.

        Poses of one stamp are separated by :func:`separate_equal_stamps`.

        Parameters
        ----------
        stamps : shape (k,) [s].
        tolerance : a pose that is further away than this is no match [s].

        Returns
        -------
        indices : shape (k,), -1 where no pose is near enough.

        Raises
        ------
        ValueError
            A stamp is not finite.
        """
        wanted = _stamp_array(stamps)
        if len(self) == 0:
            return np.full(wanted.shape, -1, dtype=np.intp)
        own = separate_equal_stamps(self.stamps, self.poses)
        after = np.minimum(np.searchsorted(own, wanted, side="right"), len(self) - 1)
        before = np.maximum(after - 1, 0)
        at = np.where((own[after] - wanted < wanted - own[before]) | (after == 0), after, before)
        near = np.minimum(np.abs(self.stamps[at] - wanted), np.abs(own[at] - wanted)) <= tolerance
        return np.where(near, at, -1)


def separate_equal_stamps(stamps: Array, poses: Array) -> Array:
    """Give poses that share a stamp times of their own.

    Such poses were sampled faster than the resolution (tick) of the clock. They are spread over their tick: evenly if
    both neighbouring ticks have poses, else at the rate of the fullest tick and next to the neighbour that has some.
    A tick is the least interval between different stamps near by. Equal poses of one stamp keep it.

    Parameters
    ----------
    stamps : shape (n,), never decreasing [s].
    poses : shape (n, 3).

    Returns
    -------
    stamps : shape (n,), none further than half a tick from what it was, never decreasing [s].
    """
    distinct, firsts, numbers, counts = np.unique(stamps, return_index=True, return_inverse=True, return_counts=True)
    moved = np.zeros(len(distinct), np.bool_)
    np.logical_or.at(moved, numbers[1:], (np.diff(stamps) == 0.0) & (np.diff(poses, axis=0) != 0.0).any(axis=1))
    steps = np.append(np.diff(distinct), np.inf)
    ticks = minimum_filter1d(steps, STAMPS_ABOUT, mode="nearest")
    goes_on = steps < 1.5 * ticks
    comes_on = np.append(False, goes_on[:-1])
    room = np.where(goes_on & comes_on, 0, counts.max(initial=0) - counts)
    begin = np.where(goes_on, room, np.where(comes_on, 0.0, 0.5 * room))
    here = (moved & np.isfinite(ticks))[numbers]
    of = numbers[here]
    place = begin[of] + 0.5 + np.flatnonzero(here) - firsts[of]
    own = stamps.copy()
    own[here] += ticks[of] * (place / (room + counts)[of] - 0.5)
    return own


def _stamp_array(stamps: ArrayLike) -> Array:
    array = np.asarray(stamps, dtype=np.float64)
    if array.ndim != 1 or not np.isfinite(array).all():
        raise ValueError(f"stamps of shape {array.shape}: expected finite seconds of shape (k,)")
    return array
