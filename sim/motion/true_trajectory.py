"""The true motion of a robot."""

from dataclasses import dataclass

import numpy as np

from features.se2 import Array, wrap_angle


@dataclass(frozen=True, slots=True, eq=False)
class TrueTrajectory:
    """True poses of a robot at a fixed rate, from time zero on.

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
        """Interpolate the poses, shape (n, 3) [m, m, rad], at times of shape (n,) [s].

        Positions and headings are interpolated linearly between neighbouring poses. Before the first pose and after
        the last the robot stands still.
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
