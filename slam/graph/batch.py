"""The batch solve of the factor graph, without the closures that the rest of it contradicts."""

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X
from numpy.typing import NDArray

from features.se2 import Array
from slam.graph.factors import closure_factor, empty_tree
from slam.graph.rules import GraphRules
from slam.graph.values import Closure, GraphEstimate


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Factor graph without closures, and where its solve may start.

    Parameters
    ----------
    graph, guess : of GTSAM.
    landmarks : indices of those that it holds, rising, shape (m,).
    rules : when a closure is revoked, and how exactly the graph is solved.
    """

    graph: gtsam.NonlinearFactorGraph
    guess: gtsam.Values
    landmarks: NDArray[np.int64]
    rules: GraphRules

    def solve(self, closures: list[Closure], max_iterations: int) -> GraphEstimate:
        """Solve with the closures that the rest does not contradict.

        Raises
        ------
        RuntimeError
            The graph does not determine its unknowns.
        """
        rules, gate = self.rules, self.rules.closure_gate
        closures = list(closures)
        revoked: list[Closure] = []
        fit = _fit(self.graph, closures, self.guess, max_iterations, rules.coarse)
        while suspects := _suspects(fit, closures, rules.suspicious**2, rules.most_suspects):
            # Wrong closures may support each other: leaving out the worst one alone may hardly lower the cost.
            leaving = _contradicted(fit, closures, suspects, fit.tree(rules.relinearize), gate)
            left = [closure for k, closure in enumerate(closures) if k not in leaving]
            without = _fit(self.graph, left, fit.values, max_iterations, rules.coarse)
            if fit.cost - without.cost <= gate:
                break
            revoked += [closures[k] for k in leaving]
            fit, closures = without, left
        fit = _fit(self.graph, closures, fit.values, max_iterations, rules.fine)
        tree = fit.tree(rules.relinearize)
        covs = [tree.marginalCovariance(L(landmark)) for landmark in self.landmarks.tolist()]
        return GraphEstimate(
            poses_world_robot=np.ascontiguousarray(gtsam.utilities.extractPose2(fit.values).reshape(-1, 3)),
            landmarks=self.landmarks,
            positions_world=gtsam.utilities.extractPoint2(fit.values).reshape(-1, 2),
            covs=np.array(covs).reshape(-1, 2, 2),
            converged=fit.converged,
            revoked=tuple(revoked),
        )

    def pose_covs(self, closures: list[Closure], key_frames: NDArray[np.int64]) -> Array:
        """Marginal covariances of key frames at the guess, shape (k, 3, 3), each in the key frame's own frame.

        Raises
        ------
        RuntimeError
            The graph does not determine its unknowns.
        """
        tree = _Fit(_with_closures(self.graph, closures), self.guess, 0.0, True).tree(self.rules.relinearize)
        return np.array([tree.marginalCovariance(X(key)) for key in key_frames.tolist()]).reshape(-1, 3, 3)

    def distances2(self, closures: list[Closure], pairs: NDArray[np.int64], variances: Array) -> Array:
        """Squared Mahalanobis distances between landmarks at the guess, see :meth:`LandmarkGraph.distances2`.

        Raises
        ------
        RuntimeError
            The graph does not determine its unknowns.
        """
        tree = _Fit(_with_closures(self.graph, closures), self.guess, 0.0, True).tree(self.rules.relinearize)
        apart = np.hstack([np.eye(2), -np.eye(2)])
        found = np.empty(len(pairs))
        for k, pair in enumerate(pairs.tolist()):
            difference = self.guess.atPoint2(L(pair[0])) - self.guess.atPoint2(L(pair[1]))
            # The covariance is symmetric in the two, so that their order in it does not matter.
            cov = apart @ tree.jointMarginalCovariance([L(landmark) for landmark in pair]).fullMatrix() @ apart.T
            found[k] = difference @ np.linalg.solve(cov + variances[k] * np.eye(2), difference)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Solution of a graph, closures at its end, and twice its cost: the sum of squared whitened residuals."""

    graph: gtsam.NonlinearFactorGraph
    values: gtsam.Values
    cost: float
    converged: bool

    def tree(self, relinearize: float) -> gtsam.ISAM2:
        tree = empty_tree(relinearize, relinearize_skip=1)
        tree.update(self.graph, self.values)  # pyright: ignore[reportUnknownMemberType]  # GTSAM leaves arguments untyped
        return tree


def _with_closures(graph: gtsam.NonlinearFactorGraph, closures: list[Closure]) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph(graph)
    for closure in closures:
        graph.add(closure_factor(closure))
    return graph


def _fit(
    graph: gtsam.NonlinearFactorGraph, closures: list[Closure], guess: gtsam.Values, max_iterations: int, end: float
) -> _Fit:
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(max_iterations)
    params.setRelativeErrorTol(end)
    # QR, as a long chain without loops is ill-conditioned, and Cholesky would square the condition number.
    params.setLinearSolverType("MULTIFRONTAL_QR")
    graph = _with_closures(graph, closures)
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, guess, params)
    values = optimizer.optimize()
    return _Fit(graph, values, 2.0 * optimizer.error(), optimizer.iterations() < max_iterations)


def _suspects(fit: _Fit, closures: list[Closure], least: float, most: int) -> list[int]:
    """Closures at a squared distance beyond the ``least``, the worst first, at ``most`` so many."""
    first = fit.graph.size() - len(closures)
    distances2 = [2.0 * fit.graph.at(first + k).error(fit.values) for k in range(len(closures))]
    worst = np.argsort(np.negative(distances2), kind="stable")[:most].tolist()
    return [k for k in worst if distances2[k] > least]


def _contradicted(fit: _Fit, closures: list[Closure], suspects: list[int], tree: gtsam.ISAM2, gate: float) -> list[int]:
    """Suspects that the rest contradicts in the linearised graph, worst first; the worst suspect if there is none."""
    first = fit.graph.size() - len(closures)
    linear = [fit.graph.at(first + k).linearize(fit.values) for k in suspects]
    ends = [(X(closures[k].older), X(closures[k].newer)) for k in suspects]
    keys = sorted({key for pair in ends for key in pair})
    cov = tree.jointMarginalCovariance(keys).fullMatrix()
    jacobian = np.zeros((len(suspects), 3, len(keys), 3))
    misfit = np.empty((len(suspects), 3))
    for row, (factor, pair) in enumerate(zip(linear, ends, strict=True)):
        by_both, misfit[row] = factor.jacobian()
        for of, key in enumerate(pair):
            jacobian[row, :, keys.index(key)] = by_both[:, 3 * of : 3 * of + 3]
    flat = jacobian.reshape(3 * len(suspects), 3 * len(keys))
    return [suspects[row] for row in outliers(misfit.ravel(), flat @ cov @ flat.T, gate)]


def outliers(misfit: Array, cov: Array, gate: float) -> list[int]:
    """Find the measurements that the rest of a linear least-squares problem contradicts, one after the other.

    Parameters
    ----------
    misfit : whitened, measured less predicted by the solution with all of them, three rows each, shape (3 m,).
    cov : covariance of what the solution predicts of the whitened measurements, shape (3 m, 3 m).
    gate : of what leaving a measurement out takes off the sum of squares (eq. M50).

    Returns
    -------
    Rows, the worst first; the worst one alone where none is beyond the gate.
    """
    misfit, cov = misfit.copy(), cov.copy()
    left = list(range(misfit.size // 3))
    out: list[int] = []
    while left:
        rows = [slice(3 * k, 3 * k + 3) for k in left]
        without = [np.linalg.solve(np.eye(3) - cov[row, row], misfit[row]) for row in rows]
        gains = [misfit[row] @ change for row, change in zip(rows, without, strict=True)]
        worst = int(np.argmax(gains))
        if out and gains[worst] <= gate:
            break
        row = rows[worst]
        gain = np.linalg.solve(np.eye(3) - cov[row, row], cov[row])
        misfit, cov = misfit + gain.T @ misfit[row], cov + cov[:, row] @ gain
        out.append(left.pop(worst))
        if gains[worst] <= gate:
            break
    return out
