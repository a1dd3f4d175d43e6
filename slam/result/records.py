"""Every record of a run: its pose in the log, its pose by odometry, and the pose of the filter when it was live."""

import math

import numpy as np

from drivers.frame import Frame
from features.se2 import Array, Pose
from slam.result.trajectory import Trajectory, separate_equal_stamps


class Records:
    """Records in the order of their stamps.

    Attributes
    ----------
    stamps : of the records [s].
    poses_odom : their odometry poses from the log without its jumps, odom frame, shape (3,) each.
    poses_map : their poses by odometry as configured, map frame, shape (3,) each.
    """

    def __init__(self) -> None:
        self.stamps: list[float] = []
        self.poses_odom: list[Pose] = []
        self.poses_map: list[Pose] = []
        self._scans: list[int] = []
        self._poses_online: list[Pose] = []

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def scans(self) -> int:
        """How many records had a scan."""
        return len(self._scans)

    def checked(self, frame: Frame) -> Pose:
        """Odometry pose of a frame that may follow; a copy, as the caller may write to its own.

        Raises
        ------
        ValueError
            The stamp is smaller than the one before, or stamp or pose is not finite.
        """
        pose_odom_robot = np.array(frame.pose_odom_robot, dtype=np.float64)
        if pose_odom_robot.shape != (3,):
            raise ValueError(f"odometry pose of shape {pose_odom_robot.shape}: expected [x, y, theta] of shape (3,)")
        if not (math.isfinite(frame.stamp) and all(map(math.isfinite, pose_odom_robot.tolist()))):
            raise ValueError(f"stamp {frame.stamp} or odometry pose {pose_odom_robot} is not finite")
        if self.stamps and frame.stamp < self.stamps[-1]:
            raise ValueError(
                f"stamp {frame.stamp} is smaller than {self.stamps[-1]} before it: expected frames in order"
            )
        return pose_odom_robot

    def add(self, stamp: float, pose_odom_robot: Pose, pose_map_robot: Pose) -> None:
        """Append a record."""
        self.stamps.append(stamp)
        self.poses_odom.append(pose_odom_robot)
        self.poses_map.append(pose_map_robot)

    def correct(self, pose_map_robot: Pose) -> None:
        """Replace the pose of the latest record by odometry, now that its scan has corrected it."""
        self.poses_map[-1] = pose_map_robot

    def add_scan(self, pose_world_robot: Pose) -> None:
        """Note that the latest record had a scan, and the pose of the filter after it."""
        self._scans.append(len(self.stamps) - 1)
        self._poses_online.append(pose_world_robot)

    def times(self) -> Array:
        """Stamps of the records, shape (n,) [s]; equal ones separated by the motion between them."""
        return separate_equal_stamps(np.array(self.stamps), np.array(self.poses_odom))

    def wheels(self) -> Trajectory:
        """Pose of every record by the log."""
        return Trajectory(self.times(), np.array(self.poses_odom))

    def odometry(self) -> Trajectory:
        """Pose of every record by odometry as configured."""
        return Trajectory(self.times(), np.array(self.poses_map))

    def online(self) -> Trajectory:
        """Pose of the filter at each scan."""
        return Trajectory(self.times()[self._scans], np.array(self._poses_online))
