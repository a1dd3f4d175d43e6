"""The sparse filter against filterpy's dense one, batch least squares, Monte Carlo and the laws of a Kalman filter."""

import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from finite_difference import assert_jacobian, finite_difference
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import block_diag
from scipy.stats import chi2

from features.se2 import compose, compose_jacobians, pose, rotation, transform, wrap_angle
from slam.errors import DivergedError
from slam.filter.ekf import LandmarkEkf, corner_jacobian, corner_jacobian_blocks, predict_corners

seeds = st.integers(0, 10_000)
headings = st.one_of(st.floats(-math.pi, math.pi), st.sampled_from([math.pi, -math.pi, math.pi - 1e-9, 1e-9 - math.pi]))
counts = st.integers(0, 5)


class DenseEkf(ExtendedKalmanFilter):
    """filterpy's filter with every matrix in full; only the motion and its Jacobians are told to it."""

    def __init__(self, x, P):
        super().__init__(dim_x=len(x), dim_z=2)
        self.x, self.P = x.copy(), P.copy()

    def predict_x(self, u=0):
        self.x = np.concatenate([compose(self.x[:3], u), self.x[3:]])

    def move(self, u, motion_cov):
        by_pose, by_motion = compose_jacobians(self.x[:3], u)
        G = np.zeros((self.dim_x, 3))
        G[:3] = by_motion
        self.F = block_diag(by_pose, np.eye(self.dim_x - 3))
        self.Q = G @ motion_cov @ G.T
        self.predict(u)

    def observe(self, positions, covs, landmarks):
        self.update(
            positions.ravel(),
            lambda x: corner_jacobian(x, landmarks).toarray(),
            lambda x: predict_corners(x, landmarks).ravel(),
            R=block_diag(*covs),
        )
        self.x[2] = wrap_angle(self.x[2])

    def augmented(self, positions, cov):
        """The filter with landmarks at these positions, robot frame: x' = f(x, z), P' = F P F' + G cov G'."""
        k = len(positions)
        turn, turned = rotation(self.x[2]), rotation(self.x[2] + math.pi / 2)
        F = np.vstack([np.eye(self.dim_x), np.zeros((2 * k, self.dim_x))])
        G = np.zeros((self.dim_x + 2 * k, 2 * k))
        for j in range(k):
            rows = slice(self.dim_x + 2 * j, self.dim_x + 2 * j + 2)
            F[rows, :2] = np.eye(2)
            F[rows, 2] = turned @ positions[j]
            G[rows, 2 * j : 2 * j + 2] = turn
        x = np.concatenate([self.x, transform(self.x[:3], positions).ravel()])
        return DenseEkf(x, F @ self.P @ F.T + G @ cov @ G.T)


def random_covs(rng, count, size=2, scale=0.05):
    roots = scale * rng.normal(size=(count, size, size))
    return roots @ roots.transpose(0, 2, 1) + 1e-6 * np.eye(size)


def joint_cov(rng, count, scale=0.05):
    """Covariance of this many points together, all correlated."""
    return random_covs(rng, 1, 2 * count, scale)[0]


def random_filter(seed, landmarks, heading=0.5, scale=0.1):
    """A filter with this many landmarks, correlated as by a drive."""
    rng = np.random.default_rng(seed)
    ekf = LandmarkEkf(pose(*rng.normal(0.0, 3.0, 2), heading), random_covs(rng, 1, 3, scale)[0])
    for _ in range(landmarks):
        ekf.add_landmarks(rng.uniform(-5.0, 5.0, (1, 2)), joint_cov(rng, 1))
        ekf.Q = random_covs(rng, 1, 3, 0.02)[0]
        ekf.predict(pose(*rng.normal(0.0, 0.3, 3)))
    return ekf, rng


def random_observation(ekf, rng, count, sigma=0.03):
    """Some of the filter's landmarks as seen from its pose, disturbed."""
    landmarks = np.sort(rng.choice(len(ekf.landmarks), count, replace=False))
    positions = predict_corners(ekf.x, landmarks) + sigma * rng.normal(size=(count, 2))
    return positions, random_covs(rng, count), landmarks


@pytest.mark.parametrize("seed", range(8))
def test_every_step_is_that_of_the_dense_filter(seed):
    rng = np.random.default_rng(seed)
    # The first heading is near the cut, so that runs cross it.
    first, cov = pose(1.0, -2.0, math.pi - 0.05), random_covs(rng, 1, 3)[0]
    ekf, dense = LandmarkEkf(first, cov), DenseEkf(first, cov)
    for step in range(30):
        if step % 5 == 0:
            new = rng.uniform(-6.0, 6.0, (rng.integers(1, 4), 2))
            cov = joint_cov(rng, len(new))
            ekf.add_landmarks(new, cov)
            dense = dense.augmented(new, cov)
        motion, Q = pose(*rng.normal([0.2, 0.0, 0.1], 0.1)), random_covs(rng, 1, 3, 0.03)[0]
        ekf.Q = Q
        ekf.predict(motion)
        dense.move(motion, Q)
        np.testing.assert_allclose(ekf.P_prior, dense.P_prior, rtol=0, atol=1e-9)
        observation = random_observation(ekf, rng, int(rng.integers(1, len(ekf.landmarks) + 1)))
        ekf.observe(*observation)
        dense.observe(*observation)
        for name in ("x", "P", "S", "SI", "K", "y", "z", "log_likelihood", "likelihood", "mahalanobis"):
            ours, theirs = getattr(ekf, name), getattr(dense, name)
            np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9, err_msg=f"{name}, step {step}")


def test_prior_and_posterior_are_those_of_filterpy():
    """P_post stays the updated covariance when the next predict has been called: a public NEES was wrong by this."""
    ekf, rng = random_filter(1, 3)
    dense = DenseEkf(ekf.x, ekf.P)
    for _ in range(4):
        ekf.Q = random_covs(rng, 1, 3)[0]
        motion = pose(*rng.normal(0.0, 0.2, 3))
        ekf.predict(motion)
        dense.move(motion, ekf.Q)
        predicted = ekf.x.copy(), ekf.P.copy()
        observation = random_observation(ekf, rng, 2)
        ekf.observe(*observation)
        dense.observe(*observation)
        updated = ekf.x.copy(), ekf.P.copy()
        assert not np.allclose(predicted[1], updated[1])
        for held, expected in [((ekf.x_prior, ekf.P_prior), predicted), ((ekf.x_post, ekf.P_post), updated)]:
            np.testing.assert_array_equal(held[0], expected[0])
            np.testing.assert_array_equal(held[1], expected[1])
        ekf.Q = np.eye(3)
        ekf.predict(pose(1.0, 0.0, 0.0))
        dense.move(pose(1.0, 0.0, 0.0), np.eye(3))
        np.testing.assert_array_equal(ekf.P_post, updated[1])
        np.testing.assert_array_equal(ekf.P_prior, ekf.P)
        for name in ("x_prior", "P_prior", "x_post", "P_post"):
            np.testing.assert_allclose(getattr(ekf, name), getattr(dense, name), atol=1e-9, err_msg=name)


@given(seeds, headings, st.integers(1, 4))
def test_corner_jacobian_is_the_derivative(seed, heading, count):
    ekf, rng = random_filter(seed, 4, heading)
    landmarks = rng.choice(4, count, replace=False)
    jacobian = corner_jacobian(ekf.x, landmarks)
    assert np.count_nonzero(jacobian.toarray()) <= 10 * count
    # Landmarks are up to some 20 m away: the third derivative by the heading is of that size.
    assert_jacobian(jacobian.toarray(), lambda x: predict_corners(x, landmarks).ravel(), ekf.x)
    by_pose, by_landmark = corner_jacobian_blocks(ekf.x, landmarks)
    for k, landmark in enumerate(landmarks):
        np.testing.assert_array_equal(jacobian.toarray()[2 * k : 2 * k + 2, :3], by_pose[k])
        np.testing.assert_array_equal(
            jacobian.toarray()[2 * k : 2 * k + 2, 3 + 2 * landmark : 5 + 2 * landmark], by_landmark
        )


@given(seeds, headings, counts)
def test_covariance_stays_one_and_an_update_never_grows_it(seed, heading, count):
    ekf, rng = random_filter(seed, count, heading)

    def assert_covariance():
        np.testing.assert_array_equal(ekf.P, ekf.P.T)
        # Rounding of a sum of products of entries of P.
        assert np.linalg.eigvalsh(ekf.P).min() >= -1e-12 * max(1.0, np.abs(ekf.P).max())
        assert -math.pi <= ekf.x[2] < math.pi

    for _ in range(4):
        ekf.Q = random_covs(rng, 1, 3, 0.05)[0]
        ekf.predict(pose(*rng.normal(0.0, 1.0, 3)))
        np.testing.assert_allclose(ekf.P, ekf.P.T, rtol=0, atol=1e-14)
        assert -math.pi <= ekf.x[2] < math.pi
        if count:
            before = ekf.P.copy()
            ekf.observe(*random_observation(ekf, rng, int(rng.integers(1, count + 1))))
            assert_covariance()
            assert np.linalg.eigvalsh(before - ekf.P).min() >= -1e-12 * max(1.0, np.abs(before).max())
        ekf.add_landmarks(rng.uniform(-5.0, 5.0, (1, 2)), joint_cov(rng, 1))
        np.testing.assert_allclose(ekf.P, ekf.P.T, rtol=0, atol=1e-14)
        count += 1


@pytest.mark.slow
@given(seeds, headings, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), headings)
def test_filter_does_not_depend_on_the_world_frame(seed, heading, x, y, theta):
    """The same drive, told in a world frame moved by g, gives the same estimate moved by g, and P turned by g."""
    g = pose(x, y, theta)

    def run(move):
        rng = np.random.default_rng(seed)
        turn = block_diag(rotation(move[2]), 1.0)
        cov = random_covs(rng, 1, 3, 0.1)[0]
        ekf = LandmarkEkf(compose(move, pose(1.0, 2.0, heading)), turn @ cov @ turn.T)
        for step in range(6):
            if step % 3 == 0:
                ekf.add_landmarks(rng.uniform(-4.0, 4.0, (2, 2)), joint_cov(rng, 2))
            ekf.Q = random_covs(rng, 1, 3, 0.03)[0]
            ekf.predict(pose(*rng.normal(0.0, 0.3, 3)))
            ekf.observe(*random_observation(ekf, rng, 2))
        return ekf

    here, there = run(pose()), run(g)
    turn = block_diag(rotation(theta), 1.0, *[rotation(theta)] * len(here.landmarks))
    # Coordinates of up to 100 m.
    np.testing.assert_allclose(there.landmarks, transform(g, here.landmarks), rtol=0, atol=1e-9)
    difference = there.pose - compose(g, here.pose)
    difference[2] = wrap_angle(difference[2])
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)
    np.testing.assert_allclose(there.P, turn @ here.P @ turn.T, rtol=0, atol=1e-9)
    assert there.mahalanobis == pytest.approx(here.mahalanobis, abs=1e-6)


@given(seeds, headings, counts)
def test_no_motion_changes_nothing(seed, heading, count):
    ekf, _ = random_filter(seed, count, heading)
    x, P = ekf.x.copy(), ekf.P.copy()
    ekf.Q = np.zeros((3, 3))
    ekf.predict(pose())
    np.testing.assert_allclose(ekf.x, x, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(ekf.P, P)


def test_one_landmark_without_landmarks_around():
    ekf, rng = random_filter(3, 0)
    assert ekf.landmarks.shape == (0, 2)
    ekf.predict(pose(0.1, 0.0, 0.1))
    assert ekf.x.shape == (3,)
    ekf.add_landmarks(np.array([[2.0, 1.0]]), joint_cov(rng, 1))
    ekf.observe(predict_corners(ekf.x, np.array([0])), random_covs(rng, 1), np.array([0]))
    assert ekf.x.shape == (5,)
    np.testing.assert_allclose(ekf.y, 0.0, atol=1e-12)


@given(seeds, headings, counts, st.integers(1, 3))
def test_birth_is_a_dense_augmentation(seed, heading, count, new):
    ekf, rng = random_filter(seed, count, heading)
    positions, cov = rng.uniform(-5.0, 5.0, (new, 2)), joint_cov(rng, new)
    expected = DenseEkf(ekf.x, ekf.P).augmented(positions, cov)
    ekf.add_landmarks(positions, cov)
    np.testing.assert_allclose(ekf.x, expected.x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ekf.P, expected.P, rtol=0, atol=1e-12)


def test_birth_covariances_are_those_of_monte_carlo():
    # Small sigmas: what the linearisation leaves out is far below the sampling error.
    ekf, rng = random_filter(5, 2, heading=2.5, scale=0.01)
    positions, cov = np.array([[3.0, -1.0], [0.5, 2.0]]), joint_cov(rng, 2, scale=0.02)
    count = 40_000
    states = rng.multivariate_normal(ekf.x, ekf.P, count)
    seen = rng.multivariate_normal(positions.ravel(), cov, count).reshape(-1, 2, 2)
    c, s = np.cos(states[:, 2]), np.sin(states[:, 2])
    turns = np.array([[c, -s], [s, c]]).transpose(2, 0, 1)
    born = states[:, None, :2] + seen @ turns.transpose(0, 2, 1)
    ekf.add_landmarks(positions, cov)
    sampled = np.cov(np.hstack([states, born.reshape(-1, 4)]).T)
    sigmas = np.sqrt(np.diag(ekf.P))
    # The sampling error of a correlation is at most 1 / sqrt(count), of a variance sqrt(2) times that.
    np.testing.assert_allclose(sampled / np.outer(sigmas, sigmas), ekf.P / np.outer(sigmas, sigmas), atol=0.03)


def test_an_impossible_covariance_is_divergence():
    ekf, _ = random_filter(2, 1)
    ekf.P = -np.eye(5)
    with pytest.raises(DivergedError, match="not positive definite"):
        ekf.observe(np.zeros((1, 2)), 1e-6 * np.eye(2)[None], np.array([0]))
    ekf.P = np.full((5, 5), np.nan)
    with pytest.raises(DivergedError, match="not positive definite"):
        ekf.observe(np.zeros((1, 2)), 1e-6 * np.eye(2)[None], np.array([0]))


@pytest.mark.parametrize("seed", range(4))
def test_with_known_headings_it_is_batch_least_squares(seed):
    """With no doubt about the heading the problem is linear: the filter's last state is that of one weighted solve."""
    rng = np.random.default_rng(seed)
    steps, count = 8, 4
    prior_cov, first = block_diag(random_covs(rng, 1)[0], 0.0), pose(0.3, -0.2, 0.4)
    landmarks_true = rng.uniform(-4.0, 4.0, (count, 2))
    ekf = LandmarkEkf(first, prior_cov)
    # Unknowns: position of every pose, then of every landmark; each row block is weighted by its Cholesky factor.
    unknowns = 2 * (steps + 1 + count)
    rows, values = [], []

    def add(blocks, value, cov):
        row = np.zeros((2, unknowns))
        for index, block in blocks:
            row[:, 2 * index : 2 * index + 2] = block
        whiten = np.linalg.inv(np.linalg.cholesky(cov))
        rows.append(whiten @ row)
        values.append(whiten @ value)

    add([(0, np.eye(2))], first[:2], prior_cov[:2, :2])
    heading = first[2]
    for step in range(steps + 1):
        if step > 0:
            motion, cov = pose(*rng.normal(0.0, 0.4, 3)), random_covs(rng, 1)[0]
            ekf.Q = block_diag(cov, 0.0)
            ekf.predict(motion)
            turn = rotation(heading)
            add([(step - 1, -np.eye(2)), (step, np.eye(2))], turn @ motion[:2], turn @ cov @ turn.T)
            heading += motion[2]
        known = np.arange(len(ekf.landmarks))
        seen = np.array([0, 1]) if step == 0 else np.array([0, 2, 3]) if step == 1 else np.sort(rng.permutation(4)[:3])
        # Not where the pose is: the estimate of a linear problem does not depend on the size of the innovations.
        positions = (landmarks_true[seen] - ekf.x[:2]) @ rotation(heading) + 0.3 * rng.normal(size=(len(seen), 2))
        covs = random_covs(rng, len(seen))
        for landmark, position, cov in zip(seen, positions, covs, strict=True):
            back = rotation(heading).T
            add([(step, -back), (steps + 1 + landmark, back)], position, cov)
        old = np.isin(seen, known)
        if old.any():
            ekf.observe(positions[old], covs[old], seen[old])
        if not old.all():
            ekf.add_landmarks(positions[~old], block_diag(*covs[~old]))
    design, target = np.vstack(rows), np.concatenate(values)
    information = design.T @ design
    solution = np.linalg.solve(information, design.T @ target)
    cov = np.linalg.inv(information)
    last = np.r_[2 * steps : 2 * steps + 2, 2 * (steps + 1) : unknowns]
    state = np.r_[0, 1, 3 : 3 + 2 * count]
    np.testing.assert_allclose(ekf.x[state], solution[last], rtol=0, atol=1e-8)
    np.testing.assert_allclose(ekf.P[np.ix_(state, state)], cov[np.ix_(last, last)], rtol=0, atol=1e-10)


@pytest.mark.slow
def test_pose_is_consistent_over_a_short_run():
    """Mean NEES of the pose within its chi-square bounds: the filter's errors are as large as it says."""
    runs, steps = 60, 25
    motion_cov = np.diag([0.01, 0.01, 0.005]) ** 2
    point_cov = np.diag([0.03, 0.03]) ** 2
    landmarks = np.array([[3.0, 3.0], [-2.0, 4.0], [5.0, -1.0], [0.0, -4.0], [-4.0, 0.0], [6.0, 5.0]])
    nees = np.empty((runs, steps))
    for run in range(runs):
        rng = np.random.default_rng(run)
        truth = pose(0.0, 0.0, 0.5)
        ekf = LandmarkEkf(truth, 1e-12 * np.eye(3))
        ekf.Q = motion_cov
        for step in range(steps):
            motion = pose(0.2, 0.0, 0.15)
            truth = compose(truth, motion + rng.multivariate_normal(np.zeros(3), motion_cov))
            ekf.predict(motion)
            positions = (landmarks - truth[:2]) @ rotation(truth[2])
            positions += rng.multivariate_normal(np.zeros(2), point_cov, len(landmarks))
            covs = np.repeat(point_cov[None], len(landmarks), axis=0)
            if step == 0:
                ekf.add_landmarks(positions, block_diag(*covs))
            else:
                ekf.observe(positions, covs, np.arange(len(landmarks)))
            error = ekf.pose - truth
            error[2] = wrap_angle(error[2])
            nees[run, step] = error @ np.linalg.solve(ekf.pose_cov, error)
    # The sum over independent runs of one step is chi-square with 3 degrees of freedom a run.
    low, high = chi2.ppf([0.0005, 0.9995], 3 * runs) / runs
    for step in (0, 1, 5, 12, steps - 1):
        assert low < nees[:, step].mean() < high, f"step {step}"


@settings(max_examples=25)
@given(seeds)
def test_observing_at_once_is_observing_one_by_one_when_linear(seed):
    """The order of independent observations does not matter where the heading is known."""
    rng = np.random.default_rng(seed)
    ekfs = []
    positions, covs, seen = rng.uniform(-4.0, 4.0, (3, 2)), random_covs(rng, 3), rng.normal(0.0, 0.1, (3, 2))
    first_cov = block_diag(random_covs(rng, 1)[0], 0.0)
    for batches in ([[0, 1, 2]], [[2], [0], [1]]):
        ekf = LandmarkEkf(pose(1.0, 2.0, -2.0), first_cov)
        ekf.add_landmarks(positions, block_diag(*covs))
        for batch in batches:
            ekf.observe(positions[batch] + seen[batch], covs[batch], np.array(batch))
        ekfs.append(ekf)
    np.testing.assert_allclose(ekfs[0].x, ekfs[1].x, atol=1e-9)
    np.testing.assert_allclose(ekfs[0].P, ekfs[1].P, atol=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_an_update_that_turns_the_robot_over_the_cut_wraps_its_heading(side):
    ekf = LandmarkEkf(pose(0.0, 0.0, side * (math.pi - 1e-3)), np.diag([1e-8, 1e-8, 0.01]))
    known = np.array([[3.0, 0.0], [0.0, 4.0]])
    ekf.add_landmarks(known, 1e-10 * np.eye(4))
    ekf.Q = np.diag([0.0, 0.0, 0.01])
    ekf.predict(pose())
    # Landmarks appear turned clockwise: the robot has turned the other way, by 0.05 rad.
    ekf.observe(known @ rotation(side * 0.05), 1e-6 * np.repeat(np.eye(2)[None], 2, axis=0), np.array([0, 1]))
    assert -math.pi <= ekf.x[2] < math.pi
    assert ekf.x[2] == pytest.approx(-side * (math.pi - 0.05 + 1e-3), abs=2e-3)
    np.testing.assert_array_equal(ekf.x_post, ekf.x)


def moved_frames(x, pose_new):
    """The state with the robot at another pose and every landmark where it is seen from it now."""
    landmarks_robot = (x[3:].reshape(-1, 2) - x[:2]) @ rotation(x[2])
    return np.concatenate([pose_new, transform(pose_new, landmarks_robot).ravel()])


@given(seeds, headings, counts)
def test_relative_landmarks_are_what_the_robot_sees_and_their_covariance_that_of_the_derivative(seed, heading, count):
    ekf, _ = random_filter(seed, count, heading)
    landmarks = np.arange(count)
    jacobian = finite_difference(lambda x: predict_corners(x, landmarks).ravel(), ekf.x) if count else np.zeros((0, 3))
    positions, cov = ekf.relative()
    assert positions.shape == (count, 2)
    np.testing.assert_array_equal(positions, predict_corners(ekf.x, landmarks))
    np.testing.assert_allclose(cov, jacobian @ ekf.P @ jacobian.T, rtol=0, atol=1e-9)


@given(seeds, headings, headings, counts)
def test_rebase_moves_the_robot_and_keeps_all_that_it_sees(seed, heading, new_heading, count):
    """What is known of the landmarks in the robot frame is the same before and after, whatever the pose is."""
    ekf, rng = random_filter(seed, count, heading)
    positions, cov = ekf.relative()
    new, new_cov = pose(*rng.normal(0.0, 20.0, 2), new_heading), random_covs(rng, 1, 3, 0.3)[0]
    ekf.rebase(new, new_cov)
    np.testing.assert_array_equal(ekf.pose, new)
    np.testing.assert_array_equal(ekf.pose_cov, new_cov)
    after, after_cov = ekf.relative()
    # Coordinates of some tens of metres.
    np.testing.assert_allclose(after, positions, rtol=0, atol=1e-12)
    np.testing.assert_allclose(after_cov, cov, rtol=0, atol=1e-10)


@given(seeds, headings, headings, counts)
def test_rebase_is_the_propagation_by_a_numeric_jacobian(seed, heading, new_heading, count):
    """The new state as a function of the old one and of the new pose, which is independent of it."""
    ekf, rng = random_filter(seed, count, heading)
    new, new_cov = pose(*rng.normal(0.0, 20.0, 2), new_heading), random_covs(rng, 1, 3, 0.3)[0]
    by_both = finite_difference(lambda both: moved_frames(both[3:], both[:3]), np.concatenate([new, ekf.x]))
    expected = by_both @ block_diag(new_cov, ekf.P) @ by_both.T
    expected_x = moved_frames(ekf.x, new)
    ekf.rebase(new, new_cov)
    np.testing.assert_allclose(ekf.x, expected_x, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ekf.P, expected, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(ekf.P_post, ekf.P)


@given(seeds, headings, st.integers(1, 3))
def test_a_filter_rebased_to_where_it_is_goes_on_from_there(seed, heading, count):
    ekf, _ = random_filter(seed, count, heading)
    x = ekf.x.copy()
    ekf.rebase(ekf.pose, ekf.pose_cov)
    np.testing.assert_allclose(ekf.x, x, rtol=0, atol=1e-12)
    assert np.linalg.eigvalsh(ekf.P).min() > 0.0
    # What is seen as it is expected changes nothing but the covariance.
    ekf.observe(predict_corners(ekf.x, np.array([0])), 1e-4 * np.eye(2)[None], np.array([0]))
    np.testing.assert_allclose(ekf.x, x, rtol=0, atol=1e-9)


@given(seeds, headings, st.integers(1, 5), st.data())
def test_forgetting_is_marginalisation(seed, heading, count, data):
    """What is left is the marginal of the dense Gaussian, here by Schur's complement of its information."""
    ekf, _ = random_filter(seed, count, heading)
    gone = np.array(data.draw(st.lists(st.integers(0, count - 1), min_size=1, unique=True)))
    information = np.linalg.inv(ekf.P)
    out = (3 + 2 * gone[:, None] + np.arange(2)).ravel()
    kept = np.setdiff1d(np.arange(ekf.x.size), out)
    left = information[np.ix_(kept, kept)] - information[np.ix_(kept, out)] @ np.linalg.solve(
        information[np.ix_(out, out)], information[np.ix_(out, kept)]
    )
    x = ekf.x[kept]
    ekf.forget(gone)
    np.testing.assert_array_equal(ekf.x, x)
    np.testing.assert_allclose(ekf.P @ left, np.eye(kept.size), rtol=0, atol=1e-5)
    assert ekf.dim_x == ekf.x.size == 3 + 2 * (count - gone.size)


@given(seeds, headings)
def test_what_a_forgotten_landmark_told_stays_and_the_rest_goes_on_as_if_it_were_there(seed, heading):
    """As long as it is not observed again, a filter that has forgotten a landmark does what one does that has not."""
    ekf, rng = random_filter(seed, 3, heading)
    ekf.observe(*random_observation(ekf, rng, 3))
    other = LandmarkEkf(ekf.pose, ekf.pose_cov)
    other.x, other.P = ekf.x.copy(), ekf.P.copy()
    ekf.forget(np.array([1]))
    motion, Q = pose(*rng.normal(0.0, 0.3, 3)), random_covs(rng, 1, 3, 0.02)[0]
    positions, covs = rng.uniform(-3.0, 3.0, (2, 2)), random_covs(rng, 2)
    for each, landmarks in ((ekf, np.array([0, 1])), (other, np.array([0, 2]))):
        each.Q = Q
        each.predict(motion)
        each.observe(positions, covs, landmarks)
    kept = np.array([0, 1, 2, 3, 4, 7, 8])
    np.testing.assert_allclose(ekf.x, other.x[kept], rtol=0, atol=1e-10)
    np.testing.assert_allclose(ekf.P, other.P[np.ix_(kept, kept)], rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_new_landmarks_leave_a_symmetric_covariance_symmetric_to_the_bit(seed):
    """Each factorisation takes one triangle for both: rounding must not tell them apart."""
    rng = np.random.default_rng(seed)
    ekf, _ = random_filter(seed, 3)
    ekf.P = 0.5 * (ekf.P + ekf.P.T)
    ekf.add_landmarks(rng.normal(0.0, 3.0, (4, 2)), joint_cov(rng, 4))
    np.testing.assert_array_equal(ekf.P, ekf.P.T)
