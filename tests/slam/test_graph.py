"""The factor graph against scipy's least squares and the dense information matrix."""

import math

import numpy as np
import pytest
from finite_difference import finite_difference
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from features.se2 import between, compose, pose, rotation, transform, wrap_angle
from slam.ekf import LandmarkEkf
from slam.graph import ANCHOR_SIGMAS, LandmarkGraph, Observations

OFF = 1e6
"""A Cauchy scale that lets no residual be an outlier: weights differ from 1 by (residual / scale)^2."""


def logarithm(pose_a_b):
    """Logarithm of SE(2): the constant twist that leads from a to b in unit time."""
    half = pose_a_b[2] / 2.0
    a = half / math.tan(half) if half else 1.0
    return np.array([*(np.array([[a, half], [-half, a]]) @ pose_a_b[:2]), pose_a_b[2]])


class Problem:
    """Key frames around a few landmarks, with noise as large as it says, and a rough first guess."""

    def __init__(self, seed, key_frames=6, landmarks=5):
        self.rng = np.random.default_rng(seed)
        rng = self.rng
        self.true_landmarks = rng.uniform(-5.0, 5.0, (landmarks, 2))
        self.true_poses = [pose(0.5, -0.5, 3.0)]
        self.motions, self.motion_covs = [np.zeros(3)], [np.eye(3)]
        for _ in range(key_frames - 1):
            motion, cov = pose(*rng.normal([0.6, 0.0, 0.5], 0.2)), self.cov(3, 0.03)
            self.true_poses.append(compose(self.true_poses[-1], motion))
            self.motions.append(motion + rng.multivariate_normal(np.zeros(3), cov))
            self.motion_covs.append(cov)
        self.seen = []
        for here in self.true_poses:
            which = np.sort(rng.choice(landmarks, landmarks - 1, replace=False))
            covs = np.array([self.cov(2, 0.03) for _ in which])
            positions = (self.true_landmarks[which] - here[:2]) @ rotation(here[2])
            noise = [rng.multivariate_normal(np.zeros(2), cov) for cov in covs]
            self.seen.append(Observations(which, positions + noise, covs))
        self.guesses = [self.true_poses[0]]
        self.guesses += [compose(each, pose(*rng.normal(0.0, 0.05, 3))) for each in self.true_poses[1:]]
        self.landmark_guesses = self.true_landmarks + rng.normal(0.0, 0.1, (landmarks, 2))

    def cov(self, size, scale):
        root = self.rng.normal(0.0, scale, (size, size))
        return root @ root.T + (0.3 * scale) ** 2 * np.eye(size)

    def graph(self, cauchy_scale=OFF):
        graph = LandmarkGraph(cauchy_scale)
        for guess, motion, cov, seen in zip(self.guesses, self.motions, self.motion_covs, self.seen, strict=True):
            graph.add_key_frame(guess, motion, cov, seen)
        return graph

    def residuals(self, unknowns):
        """Whitened residuals, ours: every one in the coordinates in which its covariance is given."""
        count = len(self.true_poses)
        poses, landmarks = unknowns[: 3 * count].reshape(-1, 3), unknowns[3 * count :].reshape(-1, 2)
        anchor = poses[0] - self.guesses[0]
        parts = [np.array([*(rotation(self.guesses[0][2]).T @ anchor[:2]), wrap_angle(anchor[2])]) / ANCHOR_SIGMAS]
        for k, seen in enumerate(self.seen):
            if k > 0:
                # In the frame of the motion's end, and there the logarithm of SE(2); the covariance is turned with it.
                error = logarithm(between(self.motions[k], between(poses[k - 1], poses[k])))
                turn = block_diag(rotation(self.motions[k][2]).T, 1.0)
                parts.append(np.linalg.solve(np.linalg.cholesky(turn @ self.motion_covs[k] @ turn.T), error))
            predicted = (landmarks[seen.landmarks] - poses[k][:2]) @ rotation(poses[k][2])
            for position, expected, cov in zip(seen.positions_robot, predicted, seen.covs, strict=True):
                # As in the graph: bearing and range, whose covariance is carried from that of the position.
                x, y = position
                rho = math.hypot(x, y)
                to_polar = np.array([[-y / rho**2, x / rho**2], [x / rho, y / rho]])
                bearing = wrap_angle(math.atan2(expected[1], expected[0]) - math.atan2(y, x))
                error = np.array([bearing, math.hypot(*expected) - rho])
                parts.append(np.linalg.solve(np.linalg.cholesky(to_polar @ cov @ to_polar.T), error))
        return np.concatenate(parts)

    def solve(self):
        start = np.concatenate([np.ravel(self.guesses), self.landmark_guesses.ravel()])
        return least_squares(self.residuals, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x


@pytest.mark.parametrize("seed", range(6))
def test_estimate_and_marginals_are_those_of_dense_least_squares(seed):
    problem = Problem(seed)
    estimate = problem.graph().optimize(problem.landmark_guesses, 100)
    solution = problem.solve()
    count = 3 * len(problem.true_poses)
    assert estimate.converged
    assert estimate.landmarks.tolist() == list(range(5))
    expected = solution[:count].reshape(-1, 3)
    # The solve ends at a relative change of the error of 1e-6, some 1e-3 of a sigma of 1e-2 m.
    np.testing.assert_allclose(estimate.poses_world_robot[:, :2], expected[:, :2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(wrap_angle(estimate.poses_world_robot[:, 2] - expected[:, 2]), 0.0, atol=1e-6)
    np.testing.assert_allclose(estimate.positions_world, solution[count:].reshape(-1, 2), rtol=0, atol=1e-6)
    jacobian = finite_difference(problem.residuals, solution, step=1e-4)
    cov = np.linalg.inv(jacobian.T @ jacobian)
    for landmark in range(5):
        block = slice(count + 2 * landmark, count + 2 * landmark + 2)
        sigmas = np.sqrt(np.diag(cov)[block])
        # The residuals are not zero: where the error of a motion is measured shifts its weight by their size.
        np.testing.assert_allclose(
            estimate.covs[landmark] / np.outer(sigmas, sigmas), cov[block, block] / np.outer(sigmas, sigmas), atol=1e-4
        )
    pose_covs = problem.graph().pose_covs(estimate, np.array([0, 2]))
    for key, found in zip((0, 2), pose_covs, strict=True):
        block = slice(3 * key, 3 * key + 3)
        turn = block_diag(rotation(expected[key][2]), 1.0)  # ours are in world coordinates
        sigmas = np.sqrt(np.diag(cov)[block])
        np.testing.assert_allclose(
            turn @ found @ turn.T / np.outer(sigmas, sigmas), cov[block, block] / np.outer(sigmas, sigmas), atol=1e-4
        )


def test_errors_are_as_large_as_the_covariances_say():
    nees = []
    for seed in range(60):
        problem = Problem(seed)
        estimate = problem.graph().optimize(problem.landmark_guesses, 100)
        errors = estimate.positions_world - problem.true_landmarks
        nees.append(errors[0] @ np.linalg.solve(estimate.covs[0], errors[0]))
    # Chi-square with 2 degrees of freedom a run: mean 2, standard deviation 2 / sqrt(60); bounds at 3.3 of them.
    assert abs(np.mean(nees) - 2.0) < 3.3 * 2.0 / math.sqrt(60)


def test_an_outlier_is_weighted_down():
    problem = Problem(1)
    clean = problem.graph().optimize(problem.landmark_guesses, 100)
    seen = problem.seen[2]
    positions = seen.positions_robot.copy()
    positions[0] += [1.0, -1.0]
    problem.seen[2] = Observations(seen.landmarks, positions, seen.covs)
    landmark = seen.landmarks[0]

    def shift(cauchy_scale):
        estimate = problem.graph(cauchy_scale).optimize(problem.landmark_guesses, 100)
        return np.linalg.norm(estimate.positions_world[landmark] - clean.positions_world[landmark])

    assert shift(2.0) < 0.02
    assert shift(2.0) < 0.1 * shift(OFF)


def test_a_landmark_seen_once_is_left_out():
    problem = Problem(2)
    once = Observations(np.array([5, 6]), np.array([[1.0, 1.0], [2.0, 0.5]]), np.repeat(0.01 * np.eye(2)[None], 2, 0))
    graph, with_once = problem.graph(), problem.graph()
    graph.add_key_frame(problem.guesses[-1], pose(0.1, 0.0, 0.0), np.eye(3), _none())
    with_once.add_key_frame(problem.guesses[-1], pose(0.1, 0.0, 0.0), np.eye(3), once)
    guesses = np.vstack([problem.landmark_guesses, [[9.0, 9.0], [8.0, 8.0]]])
    first, second = graph.optimize(guesses, 100), with_once.optimize(guesses, 100)
    assert second.landmarks.tolist() == list(range(5))
    np.testing.assert_array_equal(first.poses_world_robot, second.poses_world_robot)
    np.testing.assert_array_equal(first.covs, second.covs)


def test_indices_of_landmarks_may_have_gaps():
    problem = Problem(3)
    shifted = [Observations(3 * s.landmarks + 2, s.positions_robot, s.covs) for s in problem.seen]
    plain = problem.graph().optimize(problem.landmark_guesses, 100)
    problem.seen = shifted
    guesses = np.full((15, 2), np.nan)
    guesses[2::3] = problem.landmark_guesses
    sparse = problem.graph().optimize(guesses, 100)
    assert sparse.landmarks.tolist() == [2, 5, 8, 11, 14]
    np.testing.assert_allclose(sparse.positions_world, plain.positions_world, rtol=0, atol=1e-9)


def _none():
    return Observations(np.empty(0, np.int64), np.empty((0, 2)), np.empty((0, 2, 2)))


def test_key_frames_without_landmarks_stay_on_odometry():
    graph = LandmarkGraph(2.0)
    graph.add_key_frame(pose(1.0, 2.0, 0.5), pose(), np.zeros((3, 3)), _none())
    alone = graph.optimize(np.empty((0, 2)), 100)
    np.testing.assert_allclose(alone.poses_world_robot, [[1.0, 2.0, 0.5]], atol=1e-12)
    assert alone.positions_world.shape == (0, 2)
    assert alone.covs.shape == (0, 2, 2)
    motion = pose(1.0, 0.3, -0.7)
    graph.add_key_frame(pose(3.0, 3.0, 0.0), motion, 0.01 * np.eye(3), _none())
    estimate = graph.optimize(np.empty((0, 2)), 100)
    np.testing.assert_allclose(estimate.poses_world_robot[1], compose(pose(1.0, 2.0, 0.5), motion), atol=1e-6)


def test_a_solve_that_runs_out_of_iterations_says_so():
    problem = Problem(4)
    assert not problem.graph().optimize(problem.landmark_guesses, 1).converged


def test_solving_does_not_change_the_graph():
    problem = Problem(5)
    graph = problem.graph()
    first, second = (graph.optimize(problem.landmark_guesses, 100) for _ in range(2))
    np.testing.assert_array_equal(first.poses_world_robot, second.poses_world_robot)
    np.testing.assert_array_equal(first.covs, second.covs)


def test_a_long_chain_on_poor_odometry_has_finite_covariances():
    """Cholesky called the system of such a chain indeterminate: its squared numbers hold no such range."""
    rng = np.random.default_rng(0)
    graph = LandmarkGraph(2.0)
    here = pose()
    cov = np.diag([0.03, 0.03, 0.1]) ** 2
    landmarks = []
    for key in range(1500):
        motion = pose(0.3, 0.0, float(rng.normal(0.0, 0.1)))
        here = compose(here, motion) if key else here
        # Each landmark is seen from two key frames in a row and never again.
        landmarks.append(transform(here, np.array([1.0, 1.0])))
        which = np.array([key - 1, key] if key else [key])
        positions = (np.array(landmarks)[which] - here[:2]) @ rotation(here[2])
        graph.add_key_frame(
            here, motion, cov, Observations(which, positions, np.repeat(1e-4 * np.eye(2)[None], len(which), 0))
        )
    estimate = graph.optimize(np.array(landmarks), 100)
    assert len(estimate.landmarks) == 1499
    assert np.isfinite(estimate.covs).all()
    eigenvalues = np.linalg.eigvalsh(estimate.covs)
    assert (eigenvalues > 0.0).all()
    assert eigenvalues[-1].max() > 100.0 * eigenvalues[0].max()


@pytest.mark.parametrize("seed", range(3))
def test_filter_and_graph_agree_where_the_problem_is_nearly_linear(seed):
    """With little noise, one drive past the same landmarks gives the same last pose and map either way."""
    rng = np.random.default_rng(seed)
    motion_cov, point_cov = np.diag([1e-3, 1e-3, 1e-4]) ** 2, np.diag([2e-3, 1e-3]) ** 2
    landmarks = rng.uniform(-5.0, 5.0, (5, 2))
    truth = pose(0.0, 0.0, 1.0)
    ekf, graph = LandmarkEkf(truth, np.diag(ANCHOR_SIGMAS**2)), LandmarkGraph(OFF)
    for key in range(8):
        motion = pose(*rng.normal([0.4, 0.0, 0.3], 0.1))
        if key:
            truth = compose(truth, motion + rng.multivariate_normal(np.zeros(3), motion_cov))
            ekf.Q = motion_cov
            ekf.predict(motion)
        positions = (landmarks - truth[:2]) @ rotation(truth[2])
        positions += rng.multivariate_normal(np.zeros(2), point_cov, 5)
        covs = np.repeat(point_cov[None], 5, axis=0)
        if key:
            ekf.observe(positions, covs, np.arange(5))
        else:
            ekf.add_landmarks(positions, covs)
        graph.add_key_frame(ekf.pose, motion, motion_cov, Observations(np.arange(5), positions, covs))
    estimate = graph.optimize(ekf.landmarks, 100)
    # A hundredth of a sigma of 1e-3 m.
    np.testing.assert_allclose(ekf.landmarks, estimate.positions_world, rtol=0, atol=2e-5)
    np.testing.assert_allclose(ekf.pose, estimate.poses_world_robot[-1], rtol=0, atol=2e-5)
    own = np.array([ekf.P[3 + 2 * k : 5 + 2 * k, 3 + 2 * k : 5 + 2 * k] for k in range(5)])
    np.testing.assert_allclose(own, estimate.covs, rtol=0, atol=0.02 * own.max())
