"""The factor graph behind the filter: key frames, odometry between them, corners seen from each, closures, on GTSAM."""

import logging
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X
from numpy.typing import NDArray
from scipy.stats import chi2

from features.se2 import Array, Pose, between, compose, rotation, transform
from slam.errors import DivergedError

logger = logging.getLogger(__name__)

ANCHOR_SIGMAS = np.array([1e-4, 1e-4, 1e-5])
"""The first key frame defines the world frame; its prior is tight enough not to show in any covariance [m, m, rad]."""

CLOSURE_GATE = float(chi2.ppf(0.9999, 3))
"""Twice the cost of a closure beyond which the rest of the graph contradicts it (eq. M50)."""

MOST_SUSPECTS = 5
"""How many closures, those that fit worst, are tried to be left out, one at a time."""

LEAST_SUSPICIOUS = 4.0
"""Squared Mahalanobis distance of a closure from the solution up to which none is tried."""


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Corners seen from a key frame, as observations of landmarks.

    Parameters
    ----------
    landmarks : indices, shape (k,).
    positions_robot : shape (k, 2) [m].
    covs : shape (k, 2, 2) [m^2].
    """

    landmarks: NDArray[np.int64]
    positions_robot: Array
    covs: Array


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Two key frames that show the same place.

    Parameters
    ----------
    older, newer : indices of the key frames.
    motion : pose of the newer one in the frame of the older one, shape (3,).
    cov : covariance of its coordinates, shape (3, 3).
    """

    older: int
    newer: int
    motion: Pose
    cov: Array


@dataclass(frozen=True, slots=True, eq=False)
class GraphEstimate:
    """Result of a batch solve.

    Parameters
    ----------
    poses_world_robot : of the key frames, shape (n, 3).
    landmarks : indices of those that the graph holds, rising, shape (m,).
    positions_world, covs : of these landmarks, shapes (m, 2) [m] and (m, 2, 2) [m^2].
    converged : the solve ended before its limit of iterations.
    revoked : closures that the rest of the graph contradicts and that were left out.
    """

    poses_world_robot: Array
    landmarks: NDArray[np.int64]
    positions_world: Array
    covs: Array
    converged: bool
    revoked: tuple[Closure, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """Solution of a graph, and twice its cost: the sum of squared whitened residuals."""

    graph: gtsam.NonlinearFactorGraph
    values: gtsam.Values
    landmarks: NDArray[np.int64]
    poses: Array
    cost: float
    converged: bool


class LandmarkGraph:
    """Collects key frames and closures; :meth:`update` keeps an estimate up to date, :meth:`optimize` solves for all.

    Parameters
    ----------
    cauchy_scale : residual, in sigmas, where the robust kernel halves the weight of a corner observation.
    """

    def __init__(self, cauchy_scale: float) -> None:
        self._kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(cauchy_scale)
        self._odometry = gtsam.NonlinearFactorGraph()
        self._observations: list[Observations] = []
        self._closures: list[Closure] = []
        self._merged_into: dict[int, int] = {}
        self._isam: gtsam.ISAM2 | None = _empty_tree(relinearize_skip=10)
        self._new_factors = gtsam.NonlinearFactorGraph()
        self._new_values = gtsam.Values()
        self._seen_once: dict[int, tuple[int, Array, Array]] = {}
        self._placed: set[int] = set()
        self._poses: Array = np.empty((0, 3))
        self._moved = False
        self._closed = False

    def __len__(self) -> int:
        return len(self._observations)

    @property
    def closures(self) -> tuple[Closure, ...]:
        """Closures that were appended so far, revoked ones too."""
        return tuple(self._closures)

    @property
    def poses_world_robot(self) -> Array:
        """Poses of the key frames by all that :meth:`update` has taken in, shape (n, 3)."""
        if self._moved and self._isam is not None:
            self._poses = gtsam.utilities.extractPose2(self._isam.calculateEstimate())
            self._moved = False
        return self._poses[: len(self)]

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """Append a key frame.

        Parameters
        ----------
        pose_world_robot : pose of the first one; where the others lie is told by their motion.
        motion, motion_cov : pose in the frame of the key frame before, shape (3,), and the covariance of its
            coordinates, shape (3, 3); not used for the first one.
        observations : corners seen from it.
        """
        key = len(self)
        if key == 0:
            pose = pose_world_robot
            prior = gtsam.noiseModel.Diagonal.Sigmas(ANCHOR_SIGMAS)
            factor = gtsam.PriorFactorPose2(X(0), gtsam.Pose2(*pose), prior)
        else:
            pose = compose(self.poses_world_robot[-1], motion)
            factor = gtsam.BetweenFactorPose2(X(key - 1), X(key), gtsam.Pose2(*motion), _noise(motion, motion_cov))
        self._odometry.add(factor)
        self._new_factors.add(factor)
        self._new_values.insert(X(key), gtsam.Pose2(*pose))
        self._poses = np.concatenate([self.poses_world_robot, pose[None]])
        self._observations.append(observations)
        for landmark, position, cov in _each(observations):
            self._observe(key, self.resolve(landmark), position, cov)

    def _observe(self, key: int, landmark: int, position: Array, cov: Array) -> None:
        """Hand an observation to the incremental solve, the first of a landmark together with the second."""
        if landmark not in self._placed:
            if landmark not in self._seen_once:
                self._seen_once[landmark] = key, position, cov
                return
            first = self._seen_once.pop(landmark)
            self._placed.add(landmark)
            self._new_values.insert(L(landmark), transform(self._poses[first[0]], first[1]))
            self._new_factors.add(self._corner_factor(first[0], landmark, *first[1:]))
        self._new_factors.add(self._corner_factor(key, landmark, position, cov))

    def add_closure(self, closure: Closure) -> None:
        """Append a closure; it may be revoked by :meth:`optimize`."""
        self._closures.append(closure)
        self._new_factors.add(self._closure_factor(closure))
        self._closed = True

    def merge(self, kept: int, other: int) -> None:
        """Take two landmarks for one: what is known of the other counts for the one that is kept."""
        self._merged_into[other] = kept

    def resolve(self, landmark: int) -> int:
        """Landmark that an index stands for after all merges."""
        while landmark in self._merged_into:
            landmark = self._merged_into[landmark]
        return landmark

    def update(self) -> None:
        """Take what is new into the estimate, by iSAM2 (Kaess et al. 2012).

        Where the graph does not determine its unknowns a warning names the reason and later key frames follow odometry
        until :meth:`optimize`.
        """
        if self._isam is None:
            return
        try:
            self._isam.update(self._new_factors, self._new_values)
            self._moved, self._closed = self._moved or self._closed, False
            if not self._moved:
                newest = self._isam.calculateEstimatePose2(X(len(self) - 1))
                self._poses[-1] = newest.x(), newest.y(), newest.theta()
        except RuntimeError as error:
            logger.warning("%s: no corrections until the end", self._undetermined(error))
            self._isam = None
        self._new_factors = gtsam.NonlinearFactorGraph()
        self._new_values = gtsam.Values()

    def newest_cov(self) -> Array | None:
        """Covariance of the coordinates of the newest key frame, world frame, shape (3, 3); None where it has none."""
        if self._isam is None:
            return None
        turn = np.eye(3)
        turn[:2, :2] = rotation(float(self.poses_world_robot[-1, 2]))
        return turn @ self._isam.marginalCovariance(X(len(self) - 1)) @ turn.T

    def optimize(self, max_iterations: int) -> GraphEstimate:
        """Solve for key frames and landmarks (Levenberg-Marquardt), without the closures that do not fit.

        A landmark seen from one key frame only adds nothing and is left out.

        Parameters
        ----------
        max_iterations : limit of the solve.

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        closures = list(self._closures)
        revoked: list[Closure] = []
        try:
            solved = self._solve(self.poses_world_robot, closures, max_iterations)
            while closures:
                # A closure pulls the solution towards itself: what it costs is told by a solution without it.
                suspects = sorted(closures, key=lambda closure: -_distance2(closure, solved.poses))[:MOST_SUSPECTS]
                if _distance2(suspects[0], solved.poses) <= LEAST_SUSPICIOUS:
                    break
                without = [
                    self._solve(solved.poses, [each for each in closures if each is not suspect], max_iterations)
                    for suspect in suspects
                ]
                best = int(np.argmin([each.cost for each in without]))
                if solved.cost - without[best].cost <= CLOSURE_GATE:
                    break
                revoked.append(suspects[best])
                closures.remove(suspects[best])
                solved = without[best]
            tree = _empty_tree(relinearize_skip=1)
            tree.update(solved.graph, solved.values)
            covs = [tree.marginalCovariance(L(int(landmark))) for landmark in solved.landmarks]
        except RuntimeError as error:
            raise self._undetermined(error) from None
        return GraphEstimate(
            poses_world_robot=solved.poses,
            landmarks=solved.landmarks,
            positions_world=np.array([solved.values.atPoint2(L(int(j))) for j in solved.landmarks]).reshape(-1, 2),
            covs=np.array(covs).reshape(-1, 2, 2),
            converged=solved.converged,
            revoked=tuple(revoked),
        )

    def _solve(self, poses_world_robot: Array, closures: list[Closure], max_iterations: int) -> "_Solved":
        params = gtsam.LevenbergMarquardtParams()
        params.setMaxIterations(max_iterations)
        params.setRelativeErrorTol(1e-6)
        # QR: a long way without a loop leaves information that differs by more than Cholesky's squared numbers hold.
        params.setLinearSolverType("MULTIFRONTAL_QR")
        graph, guess, landmarks = self._with_observations(poses_world_robot, closures)
        optimizer = gtsam.LevenbergMarquardtOptimizer(graph, guess, params)
        values = optimizer.optimize()
        poses = gtsam.utilities.extractPose2(values).reshape(-1, 3)
        converged = optimizer.iterations() < max_iterations
        return _Solved(graph, values, landmarks, poses, 2.0 * optimizer.error(), converged)

    def pose_covs(self, estimate: GraphEstimate, key_frames: NDArray[np.int64]) -> Array:
        """Marginal covariances of key frames at a solution, shape (k, 3, 3), each in the key frame's own frame.

        Parameters
        ----------
        estimate : of :meth:`optimize`, with no key frame added since.
        key_frames : indices, shape (k,).

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        closures = [closure for closure in self._closures if closure not in estimate.revoked]
        graph, values, _ = self._with_observations(estimate.poses_world_robot, closures)
        for landmark, position in zip(estimate.landmarks.tolist(), estimate.positions_world, strict=True):
            values.update(L(landmark), position)
        tree = _empty_tree(relinearize_skip=1)
        try:
            tree.update(graph, values)
            return np.array([tree.marginalCovariance(X(int(key))) for key in key_frames]).reshape(-1, 3, 3)
        except RuntimeError as error:
            raise self._undetermined(error) from None

    def unsolved(self) -> GraphEstimate:
        """Return the estimate so far, for the key frames and landmarks that :meth:`optimize` would solve for."""
        poses = self.poses_world_robot
        landmarks = self._determined()
        values = self._with_observations(poses, [])[1]
        return GraphEstimate(
            poses_world_robot=poses,
            landmarks=landmarks,
            positions_world=np.array([values.atPoint2(L(int(j))) for j in landmarks]).reshape(-1, 2),
            covs=np.full((len(landmarks), 2, 2), np.nan),
            converged=False,
        )

    def _undetermined(self, error: RuntimeError) -> DivergedError:
        reason = str(error).strip().splitlines()[0]
        return DivergedError(f"the graph of {len(self)} key frames has no unique solution: {reason}")

    def _determined(self) -> NDArray[np.int64]:
        """Return the landmarks that two key frames or more have seen, rising."""
        seen = [{self.resolve(j) for j in observed.landmarks.tolist()} for observed in self._observations]
        landmarks, counts = np.unique(np.array([j for each in seen for j in each], np.int64), return_counts=True)
        return landmarks[counts >= 2]

    def _with_observations(
        self, poses_world_robot: Array, closures: list[Closure]
    ) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values, NDArray[np.int64]]:
        landmarks = self._determined()
        held = set(landmarks.tolist())
        graph = gtsam.NonlinearFactorGraph(self._odometry)
        values = gtsam.Values()
        for key, (pose, observed) in enumerate(zip(poses_world_robot, self._observations, strict=True)):
            values.insert(X(key), gtsam.Pose2(*pose))
            for index, position, cov in _each(observed):
                landmark = self.resolve(index)
                if landmark not in held:
                    continue
                if not values.exists(L(landmark)):
                    values.insert(L(landmark), transform(pose, position))
                graph.add(self._corner_factor(key, landmark, position, cov))
        for closure in closures:
            graph.add(self._closure_factor(closure))
        return graph, values, landmarks

    def _closure_factor(self, closure: Closure) -> gtsam.BetweenFactorPose2:
        """Closure with its full weight: a kernel would let a long way of small errors outvote it."""
        return gtsam.BetweenFactorPose2(
            X(closure.older), X(closure.newer), gtsam.Pose2(*closure.motion), _noise(closure.motion, closure.cov)
        )

    def _corner_factor(self, key: int, landmark: int, position: Array, cov: Array) -> gtsam.BearingRangeFactor2D:
        """Corner observation in GTSAM's coordinates, bearing and range, with the whole covariance (eq. M19)."""
        x, y = position
        rho = float(np.hypot(x, y))
        to_polar = np.array([[-y / rho**2, x / rho**2], [x / rho, y / rho]])
        noise = gtsam.noiseModel.Gaussian.Covariance(to_polar @ cov @ to_polar.T)
        return gtsam.BearingRangeFactor2D(
            X(key), L(landmark), gtsam.Rot2.atan2(y, x), rho, gtsam.noiseModel.Robust.Create(self._kernel, noise)
        )


def _each(observations: Observations) -> zip:
    return zip(observations.landmarks.tolist(), observations.positions_robot, observations.covs, strict=True)


def _noise(motion: Pose, cov: Array) -> gtsam.noiseModel.Gaussian:
    """Covariance of a motion's coordinates for GTSAM, which takes the error of a motion in the frame of its end."""
    to_end = np.eye(3)
    to_end[:2, :2] = rotation(motion[2]).T
    return gtsam.noiseModel.Gaussian.Covariance(to_end @ cov @ to_end.T)


def _distance2(closure: Closure, poses_world_robot: Array) -> float:
    """Squared Mahalanobis distance of a closure from where the poses put its key frames."""
    found = between(poses_world_robot[closure.older], poses_world_robot[closure.newer])
    error = between(closure.motion, found)
    turn = np.eye(3)
    turn[:2, :2] = rotation(closure.motion[2]).T
    return float(error @ np.linalg.solve(turn @ closure.cov @ turn.T, error))


def _empty_tree(relinearize_skip: int) -> gtsam.ISAM2:
    """Tree that is eliminated by QR, iSAM2's and from Python GTSAM's only way to marginals of a long open way."""
    params = gtsam.ISAM2Params()
    params.setFactorization("QR")
    params.setRelinearizeThreshold(0.05)
    params.relinearizeSkip = relinearize_skip
    return gtsam.ISAM2(params)
