"""Odometry that jumps: in one record it takes a step that the robot did not make, or starts anew at zero."""

from dataclasses import dataclass

import numpy as np

from features.se2 import Array, Pose, between, compose
from sim.motion.odometry import Odometry


@dataclass(frozen=True, slots=True, eq=False)
class JumpingOdometry:
    """Another odometry with a jump in one of its records.

    Parameters
    ----------
    odometry : what the records are made by.
    at : number of the first record behind the jump.
    motion : that is added to the motion up to this record, in the robot's frame there, shape (3,) [m, m, rad]; None for
        an odometry that starts anew at zero.
    """

    odometry: Odometry
    at: int
    motion: Pose | None

    def __post_init__(self) -> None:
        if self.at < 1:
            raise ValueError(f"at is {self.at}: expected the number of a record with one before it")

    def record(self, poses_world_robot: Array, rng: np.random.Generator) -> Array:
        """Return the odometry of true poses, both of shape (n, 3) [m, m, rad]; the first pose is the true one."""
        poses = self.odometry.record(poses_world_robot, rng)
        behind = poses[self.at :]
        if len(behind):
            start = np.zeros(3) if self.motion is None else compose(behind[0], self.motion)
            poses[self.at :] = [compose(start, between(behind[0], pose)) for pose in behind]
        return poses
