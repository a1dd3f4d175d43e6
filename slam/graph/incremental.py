"""The factor graph behind the filter: key frames, odometry between them, corners seen from each, closures, on GTSAM."""

import logging
from collections.abc import Iterator

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X
from numpy.typing import NDArray

from features.se2 import Array, Pose, compose, rotation, transform
from slam.errors import DivergedError
from slam.graph.batch import Problem
from slam.graph.factors import anchor_factor, closure_factor, corner_factor, empty_tree, odometry_factor
from slam.graph.rules import GraphRules
from slam.graph.values import Closure, GraphEstimate, Observations

logger = logging.getLogger(__name__)


class LandmarkGraph:
    """Collects key frames and closures; :meth:`update` keeps an estimate up to date, :meth:`optimize` solves for all.

    Parameters
    ----------
    cauchy_scale : residual, in sigmas, where the robust kernel halves the weight of a corner observation.
    rules : when a closure is revoked, where the graph is fixed, and how exactly it is solved.
    """

    def __init__(self, cauchy_scale: float, rules: GraphRules = GraphRules()) -> None:  # noqa: B008, frozen
        self._rules = rules
        self._kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(cauchy_scale)
        self._odometry = gtsam.NonlinearFactorGraph()
        self._observations: list[Observations] = []
        self._closures: list[Closure] = []
        self._merged_into: dict[int, int] = {}
        self._isam: gtsam.ISAM2 | None = empty_tree(rules.relinearize, rules.relinearize_skip)
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
            self._poses = np.ascontiguousarray(gtsam.utilities.extractPose2(self._isam.calculateEstimate()))
            self._moved = False
        return self._poses[: len(self)]

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """Append a key frame.

        Parameters
        ----------
        pose_world_robot : pose of the first key frame; ignored for later ones, which start from their motions.
        motion, motion_cov : pose in the frame of the key frame before, shape (3,), and the covariance of its
            coordinates, shape (3, 3); not used for the first one.
        observations : corners seen from it.
        """
        key = len(self)
        if key == 0:
            pose = pose_world_robot
            factor = anchor_factor(pose, self._rules.anchor_sigmas)
        else:
            pose = compose(self.poses_world_robot[-1], motion)
            factor = odometry_factor(key, motion, motion_cov)
        self._odometry.add(factor)
        self._new_factors.add(factor)
        self._new_values.insert(X(key), gtsam.Pose2(*pose))
        self._poses = np.concatenate([self.poses_world_robot, pose[None]])
        self._observations.append(observations)
        for landmark, position, cov in _each(observations):
            self._observe(key, self.resolve(landmark), position, cov)

    def _observe(self, key: int, landmark: int, position: Array, cov: Array) -> None:
        """Add an observation to the factors for iSAM2; the first one of a landmark is withheld until the second."""
        if landmark not in self._placed:
            if landmark not in self._seen_once:
                self._seen_once[landmark] = key, position, cov
                return
            first = self._seen_once.pop(landmark)
            self._placed.add(landmark)
            self._new_values.insert(L(landmark), transform(self._poses[first[0]], first[1]))
            self._new_factors.add(corner_factor(first[0], landmark, *first[1:], self._kernel))
        self._new_factors.add(corner_factor(key, landmark, position, cov, self._kernel))

    def add_closure(self, closure: Closure) -> None:
        """Append a closure; it may be revoked by :meth:`optimize`."""
        self._closures.append(closure)
        self._new_factors.add(closure_factor(closure))
        self._closed = True

    def merge(self, kept: int, other: int) -> None:
        """Merge two landmarks: all observations of ``other`` become observations of ``kept``."""
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
            self._isam.update(self._new_factors, self._new_values)  # pyright: ignore[reportUnknownMemberType]  # GTSAM leaves arguments untyped
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
        try:
            return self._problem().solve(self._closures, max_iterations)
        except RuntimeError as error:
            raise self._undetermined(error) from None

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
        try:
            return self._solved(estimate).pose_covs(self._kept(estimate), key_frames)
        except RuntimeError as error:
            raise self._undetermined(error) from None

    def distances2(self, estimate: GraphEstimate, pairs: NDArray[np.int64], variances: Array) -> Array:
        """Squared Mahalanobis distances between landmarks at a solution, 2 degrees of freedom (eq. M61), shape (k,).

        Parameters
        ----------
        estimate : of :meth:`optimize`, with no key frame or merge added since.
        pairs : landmarks of it, shape (k, 2).
        variances : added in x and y to the covariance of each difference, shape (k,) [m^2].

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        try:
            return self._solved(estimate).distances2(self._kept(estimate), pairs, variances)
        except RuntimeError as error:
            raise self._undetermined(error) from None

    def _solved(self, estimate: GraphEstimate) -> Problem:
        problem = self._problem()
        for key, pose in enumerate(estimate.poses_world_robot):
            problem.guess.update(X(key), gtsam.Pose2(*pose))
        for landmark, position in zip(estimate.landmarks.tolist(), estimate.positions_world, strict=True):
            problem.guess.update(L(landmark), position)
        return problem

    def _kept(self, estimate: GraphEstimate) -> list[Closure]:
        return [closure for closure in self._closures if closure not in estimate.revoked]

    def unsolved(self) -> GraphEstimate:
        """Return the estimate so far, for the key frames and landmarks that :meth:`optimize` would solve for."""
        problem = self._problem()
        return GraphEstimate(
            poses_world_robot=self.poses_world_robot,
            landmarks=problem.landmarks,
            positions_world=gtsam.utilities.extractPoint2(problem.guess).reshape(-1, 2),
            covs=np.full((len(problem.landmarks), 2, 2), np.nan),
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

    def _problem(self) -> Problem:
        """Return the graph of all factors but the closures, with the current estimate as initial values."""
        landmarks = self._determined()
        held = set(landmarks.tolist())
        graph = gtsam.NonlinearFactorGraph(self._odometry)
        guess = gtsam.Values()
        known = gtsam.Values() if self._isam is None else self._isam.calculateEstimate()
        for key, (pose, observed) in enumerate(zip(self.poses_world_robot, self._observations, strict=True)):
            guess.insert(X(key), gtsam.Pose2(*pose))
            for index, position, cov in _each(observed):
                landmark = self.resolve(index)
                if landmark not in held:
                    continue
                name = L(landmark)
                if not guess.exists(name):
                    guess.insert(name, known.atPoint2(name) if known.exists(name) else transform(pose, position))
                graph.add(corner_factor(key, landmark, position, cov, self._kernel))
        return Problem(graph, guess, landmarks, self._rules)


def _each(observations: Observations) -> Iterator[tuple[int, Array, Array]]:
    return zip(observations.landmarks.tolist(), observations.positions_robot, observations.covs, strict=True)
