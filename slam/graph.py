"""The factor graph behind the filter: key frames, odometry between them, and the corners seen from each, on GTSAM."""

from collections.abc import Iterable
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X
from numpy.typing import NDArray

from features.se2 import Array, Pose, rotation
from slam.errors import DivergedError

ANCHOR_SIGMAS = np.array([1e-4, 1e-4, 1e-5])
"""The first key frame defines the world frame; its prior is tight enough not to show in any covariance [m, m, rad]."""


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
class GraphEstimate:
    """Result of a batch solve.

    Parameters
    ----------
    poses_world_robot : of the key frames, shape (n, 3).
    landmarks : indices of those that the graph holds, rising, shape (m,).
    positions_world, covs : of these landmarks, shapes (m, 2) [m] and (m, 2, 2) [m^2].
    converged : the solve ended before its limit of iterations.
    """

    poses_world_robot: Array
    landmarks: NDArray[np.int64]
    positions_world: Array
    covs: Array
    converged: bool


class LandmarkGraph:
    """Collects key frames; :meth:`optimize` solves for all of them at once.

    Parameters
    ----------
    cauchy_scale : residual, in sigmas, where the robust kernel halves the weight of a corner observation.
    """

    def __init__(self, cauchy_scale: float) -> None:
        self._kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(cauchy_scale)
        self._graph = gtsam.NonlinearFactorGraph()
        self._poses: list[Pose] = []
        self._observations: list[Observations] = []

    def __len__(self) -> int:
        return len(self._poses)

    def add_key_frame(
        self, pose_world_robot: Pose, motion: Pose, motion_cov: Array, observations: Observations
    ) -> None:
        """Append a key frame.

        Parameters
        ----------
        pose_world_robot : first guess of its pose.
        motion, motion_cov : pose in the frame of the key frame before, shape (3,), and the covariance of its
            coordinates, shape (3, 3); not used for the first one.
        observations : corners seen from it.
        """
        key = len(self._poses)
        if key == 0:
            prior = gtsam.noiseModel.Diagonal.Sigmas(ANCHOR_SIGMAS)
            self._graph.add(gtsam.PriorFactorPose2(X(0), gtsam.Pose2(*pose_world_robot), prior))
        else:
            # GTSAM takes the error of a motion in the frame of its end; the covariance is given in that of its start.
            to_end = np.eye(3)
            to_end[:2, :2] = rotation(motion[2]).T
            noise = gtsam.noiseModel.Gaussian.Covariance(to_end @ motion_cov @ to_end.T)
            self._graph.add(gtsam.BetweenFactorPose2(X(key - 1), X(key), gtsam.Pose2(*motion), noise))
        self._poses.append(pose_world_robot)
        self._observations.append(observations)

    def optimize(self, positions_world: Array, max_iterations: int) -> GraphEstimate:
        """Solve for key frames and landmarks (Levenberg-Marquardt).

        A landmark seen from one key frame only adds nothing and is left out.

        Parameters
        ----------
        positions_world : first guess of every landmark by index, shape (n, 2) [m].
        max_iterations : limit of the solve.

        Raises
        ------
        DivergedError
            The graph does not determine its unknowns.
        """
        graph, values, landmarks = self._with_observations(self._poses, positions_world)
        params = gtsam.LevenbergMarquardtParams()
        params.setMaxIterations(max_iterations)
        params.setRelativeErrorTol(1e-6)
        # QR: a long way without a loop leaves information that differs by more than Cholesky's squared numbers hold.
        params.setLinearSolverType("MULTIFRONTAL_QR")
        try:
            optimizer = gtsam.LevenbergMarquardtOptimizer(graph, values, params)
            solution = optimizer.optimize()
            tree = _eliminate_qr(graph, solution)
            covs = [tree.marginalCovariance(L(int(landmark))) for landmark in landmarks]
        except RuntimeError as error:
            raise self._undetermined(error) from None
        poses = [solution.atPose2(X(key)) for key in range(len(self))]
        return GraphEstimate(
            poses_world_robot=np.array([[p.x(), p.y(), p.theta()] for p in poses]).reshape(-1, 3),
            landmarks=landmarks,
            positions_world=np.array([solution.atPoint2(L(int(j))) for j in landmarks]).reshape(-1, 2),
            covs=np.array(covs).reshape(-1, 2, 2),
            converged=optimizer.iterations() < max_iterations,
        )

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
        positions = np.zeros((int(estimate.landmarks.max(initial=-1)) + 1, 2))
        positions[estimate.landmarks] = estimate.positions_world
        graph, solution, _ = self._with_observations(estimate.poses_world_robot, positions)
        try:
            tree = _eliminate_qr(graph, solution)
            return np.array([tree.marginalCovariance(X(int(key))) for key in key_frames]).reshape(-1, 3, 3)
        except RuntimeError as error:
            raise self._undetermined(error) from None

    def unsolved(self, positions_world: Array, covs: Array) -> GraphEstimate:
        """Return the first guesses of the key frames and of the landmarks that :meth:`optimize` would solve for.

        Parameters
        ----------
        positions_world, covs : of every landmark by index, shapes (n, 2) [m] and (n, 2, 2) [m^2].
        """
        landmarks = self._determined()
        return GraphEstimate(
            poses_world_robot=np.array(self._poses).reshape(-1, 3),
            landmarks=landmarks,
            positions_world=positions_world[landmarks],
            covs=covs[landmarks],
            converged=False,
        )

    def _undetermined(self, error: RuntimeError) -> DivergedError:
        reason = str(error).strip().splitlines()[0]
        return DivergedError(f"the graph of {len(self)} key frames has no unique solution: {reason}")

    def _determined(self) -> NDArray[np.int64]:
        """Return the landmarks that two key frames or more have seen, rising."""
        seen = [observations.landmarks for observations in self._observations]
        landmarks, counts = np.unique(np.concatenate([*seen, np.empty(0, np.int64)]), return_counts=True)
        return landmarks[counts >= 2]

    def _with_observations(
        self, poses_world_robot: Iterable[Pose], positions_world: Array
    ) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values, NDArray[np.int64]]:
        landmarks = self._determined()
        held = set(landmarks.tolist())
        graph = gtsam.NonlinearFactorGraph(self._graph)
        values = gtsam.Values()
        for key, pose in enumerate(poses_world_robot):
            values.insert(X(key), gtsam.Pose2(*pose))
        for landmark in landmarks:
            values.insert(L(int(landmark)), positions_world[landmark])
        for key, observed in enumerate(self._observations):
            for landmark, position, cov in zip(
                observed.landmarks.tolist(), observed.positions_robot, observed.covs, strict=True
            ):
                if landmark in held:
                    graph.add(self._corner_factor(key, landmark, position, cov))
        return graph, values, landmarks

    def _corner_factor(self, key: int, landmark: int, position: Array, cov: Array) -> gtsam.BearingRangeFactor2D:
        """Corner observation in GTSAM's coordinates, bearing and range, with the whole covariance (eq. M19)."""
        x, y = position
        rho = float(np.hypot(x, y))
        to_polar = np.array([[-y / rho**2, x / rho**2], [x / rho, y / rho]])
        noise = gtsam.noiseModel.Gaussian.Covariance(to_polar @ cov @ to_polar.T)
        return gtsam.BearingRangeFactor2D(
            X(key), L(landmark), gtsam.Rot2.atan2(y, x), rho, gtsam.noiseModel.Robust.Create(self._kernel, noise)
        )


def _eliminate_qr(graph: gtsam.NonlinearFactorGraph, solution: gtsam.Values) -> gtsam.ISAM2:
    """Bayes tree at the solution; iSAM2 is GTSAM's only way to marginals by QR from Python."""
    params = gtsam.ISAM2Params()
    params.setFactorization("QR")
    tree = gtsam.ISAM2(params)
    tree.update(graph, solution)
    return tree
