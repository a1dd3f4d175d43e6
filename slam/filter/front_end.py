"""The filter on the landmarks near the robot, and the life of landmarks: birth, merging, inactivity and removal."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial.distance import pdist

from features.feature import Corners
from features.scan import LaserScan
from features.se2 import Array, Pose, rotate_each, transform_inverse, wrap_angle
from features.sensor import SensorModel
from features.signature import Kind, alike
from slam.filter.association import Association, Associator, Gates, associate, associate_identified
from slam.filter.ekf import POSE_DIM, LandmarkEkf, block_diagonal, corner_jacobian_blocks
from slam.filter.landmark_table import ACTIVE, LandmarkTable
from slam.filter.rules import FilterRules
from slam.odometry.beams import IN_SIGHT, PASSED, look_at

Indices = NDArray[np.int64]


class FrontEnd:
    """EKF-SLAM on the landmarks near the robot.

    Parameters
    ----------
    pose_world_robot, cov : first pose, shape (3,), and its covariance, shape (3, 3).
    gates : of the association.
    keep_distance : landmarks farther from the robot become inactive [m].
    associator : another association than :func:`slam.filter.association.associate`; None for that one.
    rules : how sure a merger is, and when beams have gone through a landmark.

    Attributes
    ----------
    ekf : the filter.
    table : what is known of every landmark.
    active : landmarks in the order of the filter's state, shape (n,).
    returned : the latest frame reactivated a landmark by its identity, so that the graph knows the pose of the robot
        better than the filter.
    """

    def __init__(
        self,
        pose_world_robot: Pose,
        cov: Array,
        gates: Gates,
        keep_distance: float,
        associator: Associator | None = None,
        rules: FilterRules = FilterRules(),  # noqa: B008, frozen
    ) -> None:
        self._rules = rules
        self.ekf = LandmarkEkf(pose_world_robot, cov)
        self.table = LandmarkTable()
        self.active: Indices = np.empty(0, np.int64)
        self.returned = False
        self._seen_at_once: set[tuple[int, int]] = set()
        self._gates = gates
        self._keep_distance = keep_distance
        self._associator = associator

    def move(self, motion: Pose, cov: Array) -> None:
        """Predict: the robot moves by ``motion``, shape (3,), with covariance (3, 3)."""
        self.ekf.Q = cov
        self.ekf.predict(motion)

    def observe(self, corners_robot: Corners, identities: Indices | None = None) -> tuple[Association, Indices]:
        """Associate the corners of a scan, update with those that are known and give birth to those that are new.

        With ``identities``, shape (k,), the association is by these alone. Against wrong identities and outliers, the
        covariance of an observation outside the gate is enlarged until the observation lies on the
        gate.

        Returns
        -------
        association : with the indices of landmarks in the table.
        landmarks : index of the landmark of each corner, -1 for none, shape (k,).
        """
        ekf, table = self.ekf, self.table
        if identities is None:
            associator = self._associator or associate
            association = associator(corners_robot, ekf, table.signatures(self.active), self._gates)
            covs = corners_robot.covs[association.corners]
        else:
            known = table.identities[self.active]
            association, covs = associate_identified(corners_robot, identities, ekf, known, self._gates.match)
        landmarks = np.full(len(corners_robot), -1)
        matched, new = association.corners, association.new
        self.returned = False
        if matched.size:
            ekf.observe(corners_robot.positions[matched], covs, association.landmarks)
            landmarks[matched] = self.active[association.landmarks]
            table.see(landmarks[matched], corners_robot, matched, ekf.x[2])
        if new.size:
            ekf.add_landmarks(corners_robot.positions[new], block_diagonal(corners_robot.covs[new]))
            landmarks[new] = self._enter(corners_robot, new, identities)
            self.active = np.concatenate([self.active, landmarks[new]])
        self._remember_apart(landmarks[(corners_robot.kinds == Kind.POINT) & (landmarks >= 0)])
        return replace(association, landmarks=landmarks[matched]), landmarks

    def _enter(self, corners_robot: Corners, new: Indices, identities: Indices | None) -> Indices:
        """Landmarks of the observations that are of none in the state: new ones, or inactive ones by their identity."""
        table, heading = self.table, float(self.ekf.x[2])
        if identities is None:
            return table.add(corners_robot, new, heading)
        landmarks = table.find(identities[new])
        back = landmarks >= 0
        self.returned = bool(back.any())
        table.activate(landmarks[back], np.zeros(np.count_nonzero(back)))
        table.see(landmarks[back], corners_robot, new[back], heading)
        landmarks[~back] = table.add(corners_robot, new[~back], heading, identities[new[~back]])
        return landmarks

    def _remember_apart(self, points: Indices) -> None:
        """Record that points of one scan are different landmarks, so that they are never merged."""
        self._seen_at_once.update(combinations(sorted(points.tolist()), 2))

    def count_misses(self, scan: LaserScan, sensor: SensorModel, seen: Indices) -> None:
        """Count what a scan shows of the landmarks not ``seen`` now; remove those that it contradicts too often.

        A landmark is missed where beams pass its place, and overlooked where its place is in sight from where both its
        walls show, no farther away than it was seen from, and no corner was found there.
        """
        if not self.active.size:
            return
        points = transform_inverse(self.ekf.pose, self.ekf.landmarks)
        shown = look_at(scan, sensor, points, self._rules.beams)
        elsewhere = ~_among(self.active, seen)
        near = np.hypot(*points.T) <= self.table.farthest[self.active]
        x, y = (self.ekf.pose[:2] - self.ekf.landmarks).T
        faced = self.table.signatures(self.active).faced(np.arctan2(y, x), self._rules.grazing)
        missed, overlooked = elsewhere & (shown == PASSED), elsewhere & (shown == IN_SIGHT) & near & faced
        self._drop(self.table.miss(self.active, missed, overlooked, self._rules.least_sighted))

    def merge(self) -> list[tuple[int, int]]:
        """Merge landmarks that are one; return the pairs, the landmark that is kept first (eq. M46-M47)."""
        merged: list[tuple[int, int]] = []
        while (pair := self._duplicates()) is not None:
            kept, other = sorted(pair, key=lambda slot: int(self.active[slot]))
            self._constrain_equal(kept, other)
            merged.append((int(self.active[kept]), int(self.active[other])))
            self.table.merge(*merged[-1])
            self._drop(np.arange(self.active.size) == other)
        return merged

    def deactivate_far(self, key_frame: int, seen: Indices) -> None:
        """Anchor the landmarks ``seen`` to the key frame that is here, and deactivate those far from the robot.

        A landmark that no key frame has seen is anchored here.
        """
        if not self.active.size:
            return
        table = self.table
        seen_now = _among(self.active, seen)
        slots = np.flatnonzero(seen_now | (table.anchors[self.active] == ACTIVE))
        if slots.size:
            positions_robot, cov = self.ekf.relative(slots)
            own = np.arange(slots.size)
            covs = cov.reshape(slots.size, 2, slots.size, 2)[own, :, own]
            table.anchor(self.active[slots], key_frame, self.ekf.x[2], positions_robot, covs)
        x, y = (self.ekf.landmarks - self.ekf.x[:2]).T
        far = ~seen_now & (np.hypot(x, y) > self._keep_distance)
        if far.any():
            table.deactivate(self.active[far])
            self._drop(far)

    def rebase(self, pose_world_robot: Pose, cov: Array) -> None:
        """Put the robot where the graph has it; the landmarks near it go along."""
        self.table.rebase(self.active, wrap_angle(float(pose_world_robot[2] - self.ekf.x[2])))
        self.ekf.rebase(pose_world_robot, cov)

    def reactivate(self, poses_world_robot: Array, key_frames: Indices, cov: Array) -> None:
        """Make inactive landmarks near the robot active again (eq. M44-M45).

        Parameters
        ----------
        poses_world_robot : of all key frames, shape (n, 3); the last one is here.
        key_frames : those whose place relative to here is known, shape (k,).
        cov : covariance of the coordinates of the pose here relative to them, world frame, shape (3, 3).
        """
        table = self.table
        known = np.flatnonzero(np.isin(table.key_frames, key_frames))
        anchor_poses = poses_world_robot[table.key_frames[known]]
        positions_world = anchor_poses[:, :2] + rotate_each(table.positions[known], anchor_poses[:, 2])
        near = np.hypot(*(positions_world - self.ekf.x[:2]).T) < self._keep_distance
        known, anchor_poses, positions_world = known[near], anchor_poses[near], positions_world[near]
        if not known.size:
            return
        state = np.concatenate([self.ekf.pose, positions_world.ravel()])
        by_pose = corner_jacobian_blocks(state, np.arange(len(known)))[0].reshape(-1, POSE_DIM)
        turns = anchor_poses[:, 2] - self.ekf.x[2]
        c, s = np.cos(turns), np.sin(turns)
        axes = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
        own = block_diagonal(axes @ table.covs[known] @ axes.transpose(0, 2, 1))
        self.ekf.add_landmarks(transform_inverse(self.ekf.pose, positions_world), own + by_pose @ cov @ by_pose.T)
        table.activate(known, anchor_poses[:, 2])
        self.active = np.concatenate([self.active, known])

    def _duplicates(self) -> tuple[int, int] | None:
        """State indices of two landmarks to merge: of equal kind and signature, difference inside the gate; or None."""
        gates, landmarks = self._gates, self.ekf.landmarks
        near = np.flatnonzero(pdist(landmarks, "sqeuclidean") < gates.birth_distance**2)
        if not near.size:
            return None
        first, second = np.array(np.triu_indices(len(landmarks), 1))[:, near]
        signatures, identities = self.table.signatures(self.active), self.table.identities[self.active]
        one = alike(signatures[first], signatures[second], gates.opening, gates.orientation)
        one &= identities[first] == identities[second]
        for i, j in zip(first[one].tolist(), second[one].tolist(), strict=True):
            if tuple(sorted((int(self.active[i]), int(self.active[j])))) in self._seen_at_once:
                continue
            difference = landmarks[i] - landmarks[j]
            H = self._difference(i, j)
            if difference @ np.linalg.solve((H @ (H @ self.ekf.P).T), difference) <= gates.match:
                return i, j
        return None

    def _constrain_equal(self, kept: int, other: int) -> None:
        """Update with an observation of zero difference between two landmarks."""
        H = self._difference(kept, other)
        self.ekf.update(np.zeros(2), lambda x: H, lambda x: H @ x, R=self._rules.merge_sigma**2 * np.eye(2))

    def _difference(self, a: int, b: int) -> csr_array:
        columns = POSE_DIM + np.array([2 * a, 2 * b, 2 * a + 1, 2 * b + 1])
        return csr_array((np.array([1.0, -1.0, 1.0, -1.0]), columns, np.array([0, 2, 4])), shape=(2, self.ekf.x.size))

    def _drop(self, dropped: NDArray[np.bool_]) -> None:
        if dropped.any():
            self.ekf.forget(np.flatnonzero(dropped))
            self.active = self.active[~dropped]


def _among(indices: Indices, others: Indices) -> NDArray[np.bool_]:
    """Whether each index is one of a few others."""
    return (indices[:, None] == others).any(axis=1)
