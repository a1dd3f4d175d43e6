"""A pose that drifts, how far its error reaches, and the motion since earlier moments."""

import numpy as np

from features.se2 import Array, Pose, between, compose, compose_jacobians, wrap_angle


class DriftingPose:
    """Pose of the robot in a frame that nothing ties to the world but the way driven.

    Parameters
    ----------
    pose_map_robot : first pose, shape (3,); without error, as it defines the frame.

    Attributes
    ----------
    pose : pose of the robot now, shape (3,).
    cov : covariance of its error, shape (3, 3).
    """

    def __init__(self, pose_map_robot: Pose) -> None:
        self.pose: Pose = np.array(pose_map_robot)
        self.cov: Array = np.zeros((3, 3))
        self._anchors: list[Anchor] = []

    def anchor(self) -> "Anchor":
        """Remember this moment, to tell the motion since."""
        self._anchors.append(Anchor(self))
        return self._anchors[-1]

    def move(self, motion: Pose, motion_cov: Array) -> None:
        """Append a motion, a pose in the robot's frame before it, with the covariance of its coordinates (eq. M11)."""
        by_pose, by_motion = compose_jacobians(self.pose, motion)
        self.cov = by_pose @ self.cov @ by_pose.T + by_motion @ motion_cov @ by_motion.T
        self.pose = compose(self.pose, motion)
        for anchor in self._anchors:
            anchor.cross = by_pose @ anchor.cross

    def doubt(self, slip: Array) -> None:
        """Allow for a slip since the anchors, shape (3,), that nothing foresaw, as large as it turned out (eq. M32)."""
        self.cov = self.cov + np.outer(slip, slip)

    def correct(self, information: Array, pull: Array) -> None:
        """Take in what a scan says of the pose, and so of the anchors (eq. M31).

        Parameters
        ----------
        information : of the pose, shape (3, 3); may be singular.
        pull : information times the difference between the scan's pose and this one, shape (3,).
        """
        shrink = np.linalg.inv(np.eye(3) + self.cov @ information)
        change = shrink @ self.cov @ pull
        rest = pull - information @ change
        loss = information @ shrink
        for anchor in self._anchors:
            anchor.pose = _shifted(anchor.pose, anchor.cross.T @ rest)
            anchor.cov = _symmetric(anchor.cov - anchor.cross.T @ loss @ anchor.cross)
            anchor.cross = shrink @ anchor.cross
        self.pose = _shifted(self.pose, change)
        self.cov = _symmetric(shrink @ self.cov)


class Anchor:
    """A moment of a :class:`DriftingPose`; knows the motion since, with its covariance.

    Attributes
    ----------
    pose, cov : pose at that moment, as it is known now, and the covariance of its error.
    cross : covariance of the error now with the error then, shape (3, 3).
    """

    def __init__(self, drifting: DriftingPose) -> None:
        self._now = drifting
        self.reset()

    def reset(self) -> None:
        """Move the anchor to this moment."""
        self.pose: Pose = self._now.pose.copy()
        self.cov: Array = self._now.cov.copy()
        self.cross: Array = self._now.cov.copy()

    @property
    def motion(self) -> Pose:
        """Pose of the robot now in its frame at that moment, shape (3,)."""
        return between(self.pose, self._now.pose)

    @property
    def motion_cov(self) -> Array:
        """Covariance of the coordinates of the motion, shape (3, 3) (eq. M33)."""
        motion = self.motion
        c, s = np.cos(self.pose[2]), np.sin(self.pose[2])
        by_now = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        by_then = -by_now
        by_then[0, 2], by_then[1, 2] = motion[1], -motion[0]
        mixed = by_now @ self.cross @ by_then.T
        return _symmetric(by_now @ self._now.cov @ by_now.T + by_then @ self.cov @ by_then.T + mixed + mixed.T)

    @property
    def travel(self) -> float:
        """Distance between that moment and now [m]."""
        motion = self.motion
        return float(np.hypot(motion[0], motion[1]))

    @property
    def turn(self) -> float:
        """Turn between that moment and now, 0 to pi [rad]."""
        return abs(float(self.motion[2]))


def _shifted(at: Pose, change: Array) -> Pose:
    moved = at + change
    moved[2] = wrap_angle(float(moved[2]))
    return moved


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)
