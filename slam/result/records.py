"""Every record of a run with its pose in the log, and every scan with its poses by odometry and by the filter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.frame import Frame
from features.se2 import Array, Pose
from slam.result.smoothing import carry_corrections
from slam.result.trajectory import Trajectory, separate_equal_stamps


@dataclass(frozen=True, slots=True, eq=False)
class ScanRecord:
    """Poses of the robot at a scan.

    Parameters
    ----------
    record : number of the record that had the scan.
    stamp : when the robot was there [s]; another time than that of the record where the beams of the scan have times.
    pose_odom : by the log, odom frame, shape (3,).
    pose_map : by odometry as configured, map frame, shape (3,).
    pose_online : by the filter after the scan, world frame, shape (3,).
    """

    record: int
    stamp: float
    pose_odom: Pose
    pose_map: Pose
    pose_online: Pose


class Records:
    """Records in the order of their stamps, and their scans.

    Parameters
    ----------
    has_odometry : whether the poses of the log follow the motion of the robot; else it moves steadily between scans.

    Attributes
    ----------
    stamps : of the records [s].
    poses_odom : their odometry poses from the log without its jumps, odom frame, shape (3,) each.
    """

    def __init__(self, *, has_odometry: bool = True) -> None:
        self.stamps: list[float] = []
        self.poses_odom: list[Pose] = []
        self._has_odometry = has_odometry
        self._poses_predicted: list[Pose] = []
        self._scans: list[ScanRecord] = []

    def __len__(self) -> int:
        return len(self.stamps)

    @property
    def scans(self) -> Sequence[ScanRecord]:
        """The scans so far."""
        return self._scans

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
        """Append a record: its pose in the log, and the predicted one by odometry as configured."""
        self.stamps.append(stamp)
        self.poses_odom.append(pose_odom_robot)
        self._poses_predicted.append(pose_map_robot)

    def add_scan(self, stamp: float, pose_odom: Pose, pose_map: Pose, pose_online: Pose) -> None:
        """Note that the latest record had a scan, see :class:`ScanRecord`; stamps of scans must not decrease."""
        self._scans.append(ScanRecord(len(self.stamps) - 1, stamp, pose_odom, pose_map, pose_online))

    def stood(self, scans: int) -> None:
        """Put so many of the latest scans where the latest one is by odometry, as the robot stood."""
        for scan in self._scans[-scans:]:
            scan.pose_map[:] = self._scans[-1].pose_map

    def times(self) -> Array:
        """Stamps of the records, shape (n,) [s]; equal ones separated by the motion between them."""
        return separate_equal_stamps(np.array(self.stamps), np.array(self.poses_odom))

    def wheels(self) -> Trajectory:
        """Pose of every record by the log."""
        return Trajectory(self.times(), np.array(self.poses_odom))

    def odometry(self) -> Trajectory:
        """Pose of every record by odometry as configured, between two scans carried from both (eq. M20)."""
        poses, of_records, _, _ = self._carried()
        return Trajectory(self.times(), poses[of_records])

    def corrected(self, scans: NDArray[np.int64], poses_world_robot: Array) -> Trajectory:
        """Pose of every record, given the corrected poses of some scans by their number, rising, shape (k, 3)."""
        poses, of_records, of_scans, stamps = self._carried()
        return Trajectory(
            self.times(), carry_corrections(poses, of_scans[scans], poses_world_robot, stamps)[of_records]
        )

    def _carried(self) -> tuple[Array, NDArray[np.int64], NDArray[np.int64], Array]:
        """Poses by odometry of records and scans in the order of time, where each is among them, and the stamps."""
        count, scans = len(self.stamps), self._scans
        stamps = np.array([*self.stamps, *(scan.stamp for scan in scans)])
        numbers = np.array([*range(count), *(scan.record for scan in scans)])
        # Of equal stamps the records come in their order, each before its scan.
        order = np.lexsort((np.arange(stamps.size) >= count, numbers, stamps))
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        if not scans:
            return np.array(self._poses_predicted), place, place[count:], stamps
        told = np.array([*self.poses_odom, *(scan.pose_odom for scan in scans)])[order]
        if not self._has_odometry:
            told[:] = 0.0
        by_scans = np.array([scan.pose_map for scan in scans])
        poses = carry_corrections(told, place[count:], by_scans, stamps[order])
        return poses, place[:count], place[count:], stamps[order]

    def online(self) -> Trajectory:
        """Pose of the filter at each scan."""
        times = self.times()
        stamps = [times[scan.record] if scan.stamp == self.stamps[scan.record] else scan.stamp for scan in self._scans]
        return Trajectory(np.array(stamps), np.array([scan.pose_online for scan in self._scans]))
