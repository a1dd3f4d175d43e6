"""A back-end of your own: SLAM in the demo's room with sparse Gauss-Newton at the end of the run instead of GTSAM.

It fulfils :class:`slam.graph.back_end.BackEnd` and nothing else of the project changes.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array
from scipy.sparse.linalg import splu

from features.se2 import Array, Pose, between, compose, rotation, transform, wrap_angle
from sim import room_run
from slam import Slam, SlamConfig, Trajectory, ate
from slam.graph.values import Closure, GraphEstimate, Observations

Indices = NDArray[np.int64]


class GaussNewtonBackEnd:
    """Follows odometry during the run, and solves for everything when it is asked to; it revokes no closure."""

    def __init__(self) -> None:
        self.closures: list[Closure] = []
        self.poses_world_robot: Array = np.empty((0, 3))
        self._motions: list[tuple[Pose, Array]] = []
        self._observations: list[Observations] = []
        self._merged: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._observations)

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """Append a key frame where odometry puts it."""
        pose = compose(self.poses_world_robot[-1], motion) if len(self) else pose_world_robot
        self.poses_world_robot = np.vstack([self.poses_world_robot, pose])
        self._motions.append((motion, motion_cov))
        self._observations.append(observations)

    def add_closure(self, closure: Closure) -> None:
        """Append a loop closure."""
        self.closures.append(closure)

    def merge(self, kept: int, other: int) -> None:
        """Take two landmarks for one."""
        self._merged[other] = kept

    def update(self) -> None:
        """Do nothing: odometry is all that is known before the end."""

    def newest_cov(self) -> Array | None:
        """Return None: without a solution there is no covariance, and the filter goes its own way."""
        return None

    def unsolved(self) -> GraphEstimate:
        """Return key frames by odometry, and no landmark."""
        empty = np.empty(0, np.int64)
        return GraphEstimate(self.poses_world_robot, empty, np.empty((0, 2)), np.empty((0, 2, 2)), converged=False)

    def optimize(self, max_iterations: int) -> GraphEstimate:
        """Solve for all key frames and landmarks by Gauss-Newton."""
        poses, landmarks = self.poses_world_robot.copy(), self._first_seen()
        names = np.array(sorted(landmarks), np.int64)
        points = np.array([landmarks[name] for name in names.tolist()]).reshape(-1, 2)
        converged = False
        for _ in range(max_iterations):
            normal, gradient = self._normal_equations(poses, names, points)
            step = splu(normal).solve(-gradient)
            poses += step[: poses.size].reshape(-1, 3)
            poses[:, 2] = wrap_angle(poses[:, 2])
            points += step[poses.size :].reshape(-1, 2)
            converged = bool(np.abs(step).max() < 1e-7)
            if converged:
                break
        cov = self._columns(poses, names, points, poses.size + np.arange(2 * len(names)))
        blocks = cov[poses.size :].reshape(len(names), 2, len(names), 2)
        own = np.arange(len(names))
        return GraphEstimate(poses, names, points, blocks[own, :, own], converged)

    def pose_covs(self, estimate: GraphEstimate, key_frames: Indices) -> Array:
        """Marginal covariances of key frames, each in its own frame."""
        poses = estimate.poses_world_robot
        covs: list[Array] = []
        for key in key_frames:
            rows = 3 * int(key) + np.arange(3)
            turn = np.eye(3)
            turn[:2, :2] = rotation(poses[key, 2]).T
            cov = self._columns(poses, estimate.landmarks, estimate.positions_world, rows)[rows]
            covs.append(turn @ cov @ turn.T)
        return np.array(covs)

    def distances2(self, estimate: GraphEstimate, pairs: Indices, variances: Array) -> Array:
        """Squared Mahalanobis distances between landmarks."""
        poses, distances2 = estimate.poses_world_robot, np.empty(len(pairs))
        for k, at in enumerate(np.searchsorted(estimate.landmarks, pairs)):
            rows = (poses.size + 2 * at[:, None] + np.arange(2)).ravel()
            cov = self._columns(poses, estimate.landmarks, estimate.positions_world, rows)[rows]
            both = np.hstack([np.eye(2), -np.eye(2)])
            apart = estimate.positions_world[at[0]] - estimate.positions_world[at[1]]
            distances2[k] = apart @ np.linalg.solve(both @ cov @ both.T + variances[k] * np.eye(2), apart)
        return distances2

    def _first_seen(self) -> dict[int, Array]:
        """Where each landmark that was seen twice lies by its first observation, world frame."""
        first: dict[int, Array] = {}
        counts: dict[int, int] = {}
        for pose, seen in zip(self.poses_world_robot, self._observations, strict=True):
            for name, position in zip(seen.landmarks.tolist(), seen.positions_robot, strict=True):
                landmark = self._resolve(name)
                first.setdefault(landmark, transform(pose, position))
                counts[landmark] = counts.get(landmark, 0) + 1
        return {name: position for name, position in first.items() if counts[name] > 1}

    def _resolve(self, landmark: int) -> int:
        while landmark in self._merged:
            landmark = self._merged[landmark]
        return landmark

    def _columns(self, poses: Array, names: Indices, points: Array, columns: Indices) -> Array:
        """Columns of the covariance of the solution."""
        normal, _ = self._normal_equations(poses, names, points)
        return splu(normal).solve(np.eye(poses.size + points.size)[:, columns])

    def _normal_equations(self, poses: Array, names: Indices, points: Array) -> tuple[csc_array, Array]:
        """Sum J' W J and J' W r over the anchor, the motions, the closures and the observations."""
        size = poses.size + points.size
        gradient = np.zeros(size)
        rows: list[Indices] = []
        columns: list[Indices] = []
        values: list[Array] = []

        def add(residual: Array, cov: Array, *blocks: tuple[int, Array]) -> None:
            weight = np.linalg.inv(cov)
            for at, jacobian in blocks:
                gradient[at : at + jacobian.shape[1]] += jacobian.T @ weight @ residual
                for other, other_jacobian in blocks:
                    block = jacobian.T @ weight @ other_jacobian
                    i, j = np.indices(block.shape)
                    rows.append((at + i).ravel())
                    columns.append((other + j).ravel())
                    values.append(block.ravel())

        def add_motion(older: int, newer: int, motion: Pose, cov: Array) -> None:
            expected = between(poses[older], poses[newer])
            residual = expected - motion
            residual[2] = wrap_angle(float(residual[2]))
            by_newer = np.eye(3)
            by_newer[:2, :2] = rotation(poses[older, 2]).T
            by_older = -by_newer
            by_older[:2, 2] = expected[1], -expected[0]
            add(residual, cov, (3 * older, by_older), (3 * newer, by_newer))

        first = poses[0] - self.poses_world_robot[0]
        add(first, np.diag([1e-8, 1e-8, 1e-10]), (0, np.eye(3)))
        for key, (motion, cov) in enumerate(self._motions[1:], start=1):
            add_motion(key - 1, key, motion, cov)
        for closure in self.closures:
            add_motion(closure.older, closure.newer, closure.motion, closure.cov)
        place = {name: poses.size + 2 * k for k, name in enumerate(names.tolist())}
        for key, seen in enumerate(self._observations):
            turn_back = rotation(poses[key, 2]).T
            for name, position, cov in zip(seen.landmarks.tolist(), seen.positions_robot, seen.covs, strict=True):
                at = place.get(self._resolve(name))
                if at is None:
                    continue
                expected = turn_back @ (points[(at - poses.size) // 2] - poses[key, :2])
                by_pose = np.column_stack([-turn_back, [expected[1], -expected[0]]])
                add(expected - position, cov, (3 * key, by_pose), (at, turn_back))
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return coo_array(entries, shape=(size, size)).tocsc(), gradient


if __name__ == "__main__":
    run = room_run(1)
    slam = Slam(SlamConfig.of_preset(run.sensor, run.mounting), back_end=GaussNewtonBackEnd)
    for frame in run:
        slam.process(frame)
    result = slam.finish()
    error = ate(Trajectory(run.stamps, run.poses_world_robot), result.trajectory)
    print(f"ATE {1e3 * error.rmse_m:.1f} mm, {len(result.landmarks)} landmarks")
