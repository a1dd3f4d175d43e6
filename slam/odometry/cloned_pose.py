# pyright: standard
"""Stochastic cloning: a drifting pose, its clones at earlier moments, and the motion since each with covariance."""

import math

import numpy as np
from numba import f8

from features.compiled import kernel
from features.se2 import Array, Pose, between, wrap_angle
from features.se2_kernels import compound


class ClonedPose:
    """Pose of the robot in a frame that drifts against the world, with clones of earlier poses.

    Parameters
    ----------
    pose_map_robot : first pose, shape (3,); without error, as it defines the frame.

    Attributes
    ----------
    pose : pose of the robot now, shape (3,).
    cov : covariance of its error, shape (3, 3).
    finite : whether pose and covariance are finite.
    """

    def __init__(self, pose_map_robot: Pose) -> None:
        self.pose: Pose = np.array(pose_map_robot)
        self.cov: Array = np.zeros((3, 3))
        self.finite = True
        self._poses: Array = np.empty((0, 3))
        self._covs: Array = np.empty((0, 3, 3))
        self._crosses: Array = np.empty((0, 3, 3))

    def clone(self) -> "PoseClone":
        """Clone the current pose, to get the motion since then with its covariance."""
        self._poses = np.concatenate([self._poses, self.pose[None]])
        self._covs = np.concatenate([self._covs, self.cov[None]])
        self._crosses = np.concatenate([self._crosses, self.cov[None]])
        return PoseClone(self, len(self._poses) - 1)

    def move(self, motion: Pose, motion_cov: Array) -> None:
        """Append a motion, a pose in the robot's frame before it, with the covariance of its coordinates (eq. M11)."""
        self.pose, self.cov, self.finite = compound(self.pose, self.cov, self._crosses, motion, motion_cov)

    def inflate(self, slip: Array) -> None:
        """Enlarge the covariance by the outer product of an unmodelled slip since the clones, shape (3,) (eq. M32)."""
        self.cov = self.cov + np.outer(slip, slip)

    def correct(self, information: Array, pull: Array) -> None:
        """Update the pose, and by its cross-covariances the clones, with the information of a registration (eq. M31).

        Parameters
        ----------
        information : of the pose, shape (3, 3); may be singular.
        pull : information times the difference between the scan's pose and this one, shape (3,).
        """
        change, self.cov = _correct(self.cov, self._poses, self._covs, self._crosses, information, pull)
        self.pose = self.pose + change
        self.pose[2] = wrap_angle(float(self.pose[2]))

    def reset(self, index: int) -> None:
        """Replace a clone by the current pose."""
        self._poses[index] = self.pose
        self._covs[index] = self._crosses[index] = self.cov

    def motion(self, index: int) -> Pose:
        """Pose of the robot in its frame at an anchor, shape (3,)."""
        return between(self._poses[index], self.pose)

    def advance(self, index: int) -> tuple[float, float]:
        """Distance [m] and turn, 0 to pi [rad], from an anchor to here."""
        x, y, turn = (self.pose - self._poses[index]).tolist()
        return math.hypot(x, y), abs(wrap_angle(turn))

    def motion_cov(self, index: int) -> Array:
        """Covariance of :meth:`motion`, shape (3, 3) (eq. M33)."""
        return _motion_cov(self._poses[index], self.pose, self._covs[index], self.cov, self._crosses[index])


class PoseClone:
    """A clone of the pose at one moment, made by :meth:`ClonedPose.clone`; gives the motion since."""

    def __init__(self, drifting: ClonedPose, index: int) -> None:
        self._drifting = drifting
        self._index = index

    def reset(self) -> None:
        """Replace the clone by the current pose."""
        self._drifting.reset(self._index)

    @property
    def motion(self) -> Pose:
        """Pose of the robot now in its frame at that moment, shape (3,)."""
        return self._drifting.motion(self._index)

    @property
    def motion_cov(self) -> Array:
        """Covariance of the coordinates of the motion, shape (3, 3)."""
        return self._drifting.motion_cov(self._index)

    @property
    def travel(self) -> float:
        """Distance between that moment and now [m]."""
        return self._drifting.advance(self._index)[0]

    @property
    def turn(self) -> float:
        """Turn between that moment and now, 0 to pi [rad]."""
        return self._drifting.advance(self._index)[1]

    def moved_beyond(self, distance: float, angle: float) -> bool:
        """Whether the robot has moved a distance [m] or turned an angle [rad] since."""
        travel, turn = self._drifting.advance(self._index)
        return travel >= distance or turn >= angle


@kernel(f8[:, ::1], f8[:, ::1], f8[:, :, ::1], f8[:, :, ::1], f8[:, ::1], f8[::1])
def _correct(cov, poses, covs, crosses, information, pull):
    """Change of the pose, and its covariance, by a scan; what belongs to the anchors is changed in place."""
    shrink = np.linalg.inv(np.eye(3) + cov @ information)
    after = shrink @ cov
    change = after @ pull
    rest = pull - information @ change
    loss = information @ shrink
    for k in range(len(poses)):
        back = crosses[k].T.copy()
        poses[k] += back @ rest
        less = covs[k] - back @ loss @ crosses[k]
        covs[k] = 0.5 * (less + less.T)
        crosses[k] = shrink @ crosses[k]
    return change, 0.5 * (after + after.T)


@kernel(f8[::1], f8[::1], f8[:, ::1], f8[:, ::1], f8[:, ::1])
def _motion_cov(pose_then, pose_now, cov_then, cov_now, cross):
    c = math.cos(pose_then[2])
    s = math.sin(pose_then[2])
    x = pose_now[0] - pose_then[0]
    y = pose_now[1] - pose_then[1]
    by_now = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    by_then = np.array([[-c, -s, c * y - s * x], [s, -c, -c * x - s * y], [0.0, 0.0, -1.0]])
    mixed = by_now @ cross @ by_then.T
    cov = by_now @ cov_now @ by_now.T + by_then @ cov_then @ by_then.T + mixed + mixed.T
    return 0.5 * (cov + cov.T)
