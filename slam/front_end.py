"""The filter on the landmarks near the robot, and the life of landmarks: birth, merging, rest and end."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_array

from features.feature import Corners
from features.scan import LaserScan
from features.se2 import TWO_PI, Array, Pose, wrap_angle
from features.sensor import SensorModel
from slam.association import Association, Gates, Signatures, associate
from slam.ekf import POSE_DIM, LandmarkEkf, corner_jacobian_blocks
from slam.landmark import GONE, LOCAL, LandmarkTable

Indices = NDArray[np.int64]

SEEN_THROUGH = 0.3
"""How far behind a landmark the beams have to end for it to be missed [m]."""

BEAMS_BESIDE = 2
"""Beams on either side of a landmark that all have to go through its place."""

MERGE_SIGMA = 0.01
"""Standard deviation of the distance of two landmarks that are one [m]."""


class FrontEnd:
    """EKF-SLAM on the landmarks near the robot.

    Parameters
    ----------
    pose_world_robot, cov : first pose, shape (3,), and its covariance, shape (3, 3).
    gates : of the association.
    keep_distance : landmarks farther from the robot are laid to rest [m].

    Attributes
    ----------
    ekf : the filter.
    table : what is known of every landmark.
    local : landmarks in the order of the filter's state, shape (n,).
    """

    def __init__(self, pose_world_robot: Pose, cov: Array, gates: Gates, keep_distance: float) -> None:
        self.ekf = LandmarkEkf(pose_world_robot, cov)
        self.table = LandmarkTable()
        self.local: Indices = np.empty(0, np.int64)
        self._gates = gates
        self._keep_distance = keep_distance

    def move(self, motion: Pose, cov: Array) -> None:
        """Predict: the robot moves by ``motion``, shape (3,), with covariance (3, 3)."""
        self.ekf.Q = cov
        self.ekf.predict(motion)

    def observe(self, corners_robot: Corners) -> tuple[Association, Indices]:
        """Associate the corners of a scan, update with those that are known and give birth to those that are new.

        Returns
        -------
        association : with the indices of landmarks in the table.
        landmarks : index of the landmark of each corner, -1 for none, shape (k,).
        """
        ekf, table = self.ekf, self.table
        association = associate(corners_robot, ekf, self._signatures(), self._gates)
        landmarks = np.full(len(corners_robot), -1)
        matched, new = association.corners, association.new
        if matched.size:
            ekf.observe(corners_robot.positions[matched], corners_robot.covs[matched], association.landmarks)
            landmarks[matched] = self.local[association.landmarks]
            table.see(landmarks[matched], corners_robot, matched, ekf.x[2])
        if new.size:
            ekf.add_landmarks(corners_robot.positions[new], np.asarray(block_diag(*corners_robot.covs[new])))
            landmarks[new] = table.add(corners_robot, new, ekf.x[2])
            self.local = np.concatenate([self.local, landmarks[new]])
        return replace(association, landmarks=landmarks[matched]), landmarks

    def miss(self, scan: LaserScan, sensor: SensorModel, seen: Indices) -> None:
        """End landmarks whose place the beams went through more often than they were seen; none ``seen`` just now."""
        if not self.local.size:
            return
        missed = seen_through(scan, sensor, transform_back(self.ekf.pose, self.ekf.landmarks))
        missed &= ~np.isin(self.local, seen)
        self.table.misses[self.local[missed]] += 1
        over = self.table.misses[self.local] > self.table.observations[self.local]
        self.table.key_frames[self.local[over]] = GONE
        self._drop(over)

    def merge(self) -> list[tuple[int, int]]:
        """Merge landmarks that are one; return the pairs, the landmark that is kept first."""
        merged = []
        while (pair := self._duplicates()) is not None:
            kept, other = sorted(pair, key=lambda slot: int(self.local[slot]))
            self._tie(kept, other)
            merged.append((int(self.local[kept]), int(self.local[other])))
            self.table.merge(*merged[-1])
            self._drop(np.arange(self.local.size) == other)
        return merged

    def rest(self, key_frame: int, seen: Indices) -> None:
        """Settle the landmarks ``seen`` from a key frame that is here, and lay those far from the robot to rest.

        A landmark that no key frame has seen settles here.
        """
        if not self.local.size:
            return
        table = self.table
        positions_robot, cov = self.ekf.relative()
        seen_now = np.isin(self.local, seen)
        slots = np.flatnonzero(seen_now | (table.homes[self.local] == LOCAL))
        blocks = 2 * slots[:, None] + np.arange(2)
        covs = cov[blocks[:, :, None], blocks[:, None, :]]
        table.settle(self.local[slots], key_frame, self.ekf.x[2], positions_robot[slots], covs)
        far = ~seen_now & (np.hypot(positions_robot[:, 0], positions_robot[:, 1]) > self._keep_distance)
        table.rest(self.local[far])
        self._drop(far)

    def rebase(self, pose_world_robot: Pose, cov: Array) -> None:
        """Put the robot where the graph has it; the landmarks near it go along."""
        self.table.rebase(self.local, wrap_angle(float(pose_world_robot[2] - self.ekf.x[2])))
        self.ekf.rebase(pose_world_robot, cov)

    def wake(self, poses_world_robot: Array, key_frames: Indices, cov: Array) -> None:
        """Take landmarks near the robot back from rest.

        Parameters
        ----------
        poses_world_robot : of all key frames, shape (n, 3); the last one is here.
        key_frames : those whose place relative to here is known, shape (k,).
        cov : covariance of the coordinates of the pose here relative to them, world frame, shape (3, 3).
        """
        table = self.table
        known = np.flatnonzero(np.isin(table.key_frames, key_frames))
        homes = poses_world_robot[table.key_frames[known]]
        c, s = np.cos(homes[:, 2]), np.sin(homes[:, 2])
        x, y = table.positions[known].T
        positions_world = homes[:, :2] + np.stack([c * x - s * y, s * x + c * y], axis=-1)
        near = np.hypot(*(positions_world - self.ekf.x[:2]).T) < self._keep_distance
        known, homes, positions_world = known[near], homes[near], positions_world[near]
        if not known.size:
            return
        state = np.concatenate([self.ekf.pose, positions_world.ravel()])
        by_pose = corner_jacobian_blocks(state, np.arange(len(known)))[0].reshape(-1, POSE_DIM)
        turns = homes[:, 2] - self.ekf.x[2]
        c, s = np.cos(turns), np.sin(turns)
        axes = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
        own = np.asarray(block_diag(*(axes @ table.covs[known] @ axes.transpose(0, 2, 1))))
        self.ekf.add_landmarks(transform_back(self.ekf.pose, positions_world), own + by_pose @ cov @ by_pose.T)
        table.wake(known, homes[:, 2])
        self.local = np.concatenate([self.local, known])

    def _signatures(self) -> Signatures:
        table, local = self.table, self.local
        return Signatures(table.convex[local], table.opening_angles[local], table.orientations[local])

    def _duplicates(self) -> tuple[int, int] | None:
        """Places of two landmarks that are one: as near as their covariance allows, of the same kind and signature."""
        signatures, gates, landmarks = self._signatures(), self._gates, self.ekf.landmarks
        a, b = np.triu_indices(len(landmarks), 1)
        apart = landmarks[a] - landmarks[b]
        close = (
            (np.hypot(apart[:, 0], apart[:, 1]) < gates.birth_distance)
            & (signatures.convex[a] == signatures.convex[b])
            & (np.abs(signatures.opening_angles[a] - signatures.opening_angles[b]) < gates.opening)
            & (np.abs(wrap_angle(signatures.orientations[a] - signatures.orientations[b])) < gates.orientation)
        )
        for i, j, difference in zip(a[close], b[close], apart[close], strict=True):
            H = self._difference(int(i), int(j))
            if difference @ np.linalg.solve((H @ (H @ self.ekf.P).T), difference) <= gates.match:
                return int(i), int(j)
        return None

    def _tie(self, kept: int, other: int) -> None:
        """Update with the knowledge that two landmarks are one."""
        H = self._difference(kept, other)
        self.ekf.update(np.zeros(2), lambda x: H, lambda x: H @ x, R=MERGE_SIGMA**2 * np.eye(2))

    def _difference(self, a: int, b: int) -> csr_array:
        columns = POSE_DIM + np.array([2 * a, 2 * b, 2 * a + 1, 2 * b + 1])
        return csr_array((np.array([1.0, -1.0, 1.0, -1.0]), columns, np.array([0, 2, 4])), shape=(2, self.ekf.x.size))

    def _drop(self, dropped: NDArray[np.bool_]) -> None:
        if dropped.any():
            self.ekf.forget(np.flatnonzero(dropped))
            self.local = self.local[~dropped]


def transform_back(pose_world_robot: Pose, points_world: Array) -> Array:
    """Points of the world frame, shape (n, 2), in the robot frame."""
    c, s = math.cos(pose_world_robot[2]), math.sin(pose_world_robot[2])
    return (points_world - pose_world_robot[:2]) @ np.array([[c, -s], [s, c]])


def seen_through(scan: LaserScan, sensor: SensorModel, points_robot: Array) -> NDArray[np.bool_]:
    """Whether every beam next to a point ends well behind it, so that nothing is there, shape (n,)."""
    if not len(scan):
        return np.zeros(len(points_robot), np.bool_)
    mounting = sensor.mounting
    points = (points_robot - np.array([mounting.x, mounting.y])) @ mounting.axes
    bearings = np.arctan2(points[:, 1], points[:, 0]) % TWO_PI
    angles = scan.angles % TWO_PI
    order = np.argsort(angles, kind="stable")
    at = np.searchsorted(angles[order], bearings)[:, None] + np.arange(-BEAMS_BESIDE, BEAMS_BESIDE)
    beside = order[at % len(order)]
    ranges = scan.ranges[beside]
    returned = (ranges > 0.0) & (ranges >= sensor.range_min) & (ranges <= sensor.range_max)
    # A gap in the scan, such as behind a sensor that does not look all round, shows nothing.
    off = np.abs(wrap_angle(angles[beside] - bearings[:, None])) * np.hypot(*points.T)[:, None]
    through = returned & (ranges > np.hypot(*points.T)[:, None] + SEEN_THROUGH) & (off < SEEN_THROUGH)
    return through.all(axis=1)
