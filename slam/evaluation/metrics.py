"""How far an estimate is from the truth: trajectory errors as evo defines them, and landmark matching."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from features.errors import CwlfError
from features.se2 import Array, Pose, align, between, transform
from slam.result.trajectory import Trajectory

ASSOCIATION_TOLERANCE = 0.02
"""Poses of two trajectories belong together if their stamps differ by no more than this [s]."""

Indices = NDArray[np.intp]


class UnmatchedError(CwlfError):
    """An estimate that has nothing in common with the truth that it is compared with."""


@dataclass(frozen=True, slots=True, eq=False)
class Ate:
    """Absolute trajectory error: distance of the positions after rigid alignment.

    Parameters
    ----------
    rmse_m, mean_m, median_m, max_m : of the distances [m].
    count : number of associated poses.
    pose_truth_estimate : the alignment, pose of the estimate's frame in that of the truth, shape (3,) [m, m, rad].
    """

    rmse_m: float
    mean_m: float
    median_m: float
    max_m: float
    count: int
    pose_truth_estimate: Pose


@dataclass(frozen=True, slots=True)
class Rpe:
    """Relative pose error: difference of the motions over a number of frames.

    Parameters
    ----------
    translation_rmse_m, translation_mean_m : of the distances [m].
    rotation_rmse_deg, rotation_mean_deg : of the absolute angles [deg].
    count : number of pairs of poses.
    """

    translation_rmse_m: float
    translation_mean_m: float
    rotation_rmse_deg: float
    rotation_mean_deg: float
    count: int


def associate(
    truth: Trajectory, estimate: Trajectory, tolerance: float = ASSOCIATION_TOLERANCE
) -> tuple[Indices, Indices]:
    """Pair each pose of the shorter trajectory with the one of the longer that is nearest in time, as evo does.

    Parameters
    ----------
    truth, estimate : trajectories of any frames.
    tolerance : the stamps of a pair differ by no more than this [s].

    Returns
    -------
    indices_truth, indices_estimate : shape (k,) each.

    Raises
    ------
    UnmatchedError
        There is no pair.
    """
    estimate_is_longer = len(estimate) > len(truth)
    short, long = (truth, estimate) if estimate_is_longer else (estimate, truth)
    indices_long = long.nearest(short.stamps, tolerance)
    indices_short = np.flatnonzero(indices_long >= 0)
    indices_long = indices_long[indices_short]
    if indices_short.size == 0:
        raise UnmatchedError(
            f"no pose of the estimate ({span(estimate)}) is within {tolerance:g} s "
            f"of a pose of the truth ({span(truth)})"
        )
    return (indices_short, indices_long) if estimate_is_longer else (indices_long, indices_short)


def ate(truth: Trajectory, estimate: Trajectory, tolerance: float = ASSOCIATION_TOLERANCE) -> Ate:
    """Absolute trajectory error after association and rigid alignment (evo: `ape`, translation part, aligned).

    Parameters
    ----------
    truth, estimate : trajectories, each in its own frame.
    tolerance : for :func:`associate` [s].

    Raises
    ------
    UnmatchedError
        The trajectories have no stamp in common.
    """
    indices_truth, indices_estimate = associate(truth, estimate, tolerance)
    points_truth = truth.poses[indices_truth, :2]
    points_estimate = estimate.poses[indices_estimate, :2]
    pose_truth_estimate = align(points_truth, points_estimate)
    errors = np.linalg.norm(transform(pose_truth_estimate, points_estimate) - points_truth, axis=1)
    return Ate(
        rmse_m=_rms(errors),
        mean_m=float(errors.mean()),
        median_m=float(np.median(errors)),
        max_m=float(errors.max()),
        count=errors.size,
        pose_truth_estimate=pose_truth_estimate,
    )


def rpe(
    truth: Trajectory,
    estimate: Trajectory,
    delta: int = 1,
    all_pairs: bool = False,
    tolerance: float = ASSOCIATION_TOLERANCE,
) -> Rpe:
    """Relative pose error over a number of associated poses (evo: `rpe`, delta in frames).

    Parameters
    ----------
    truth, estimate : trajectories, each in its own frame.
    delta : number of associated poses from one end of a pair to the other.
    all_pairs : a pair starts at every pose; otherwise where the last one ended.
    tolerance : for :func:`associate` [s].

    Raises
    ------
    ValueError
        delta is less than 1.
    UnmatchedError
        Fewer than delta + 1 poses have stamps in common.
    """
    if delta < 1:
        raise ValueError(f"delta is {delta}: expected at least 1")
    indices_truth, indices_estimate = associate(truth, estimate, tolerance)
    count = indices_truth.size
    if count <= delta:
        raise UnmatchedError(f"{count} poses of the estimate match the truth in time: expected at least {delta + 1}")
    starts = np.arange(0, count - delta, 1 if all_pairs else delta)
    errors = pose_differences(
        motions_between(truth.poses, indices_truth[starts], indices_truth[starts + delta]),
        motions_between(estimate.poses, indices_estimate[starts], indices_estimate[starts + delta]),
    )
    translations, rotations = magnitudes(errors)
    return Rpe(
        translation_rmse_m=_rms(translations),
        translation_mean_m=float(translations.mean()),
        rotation_rmse_deg=_rms(rotations),
        rotation_mean_deg=float(rotations.mean()),
        count=starts.size,
    )


def match_landmarks(landmarks_truth: ArrayLike, landmarks_estimate: ArrayLike, max_distance: float) -> Indices:
    """Match landmarks one to one: as many as possible, and among these the set with the least sum of distances.

    Parameters
    ----------
    landmarks_truth : shape (k, 2) [m].
    landmarks_estimate : shape (m, 2) [m], same frame.
    max_distance : landmarks further apart do not match [m].

    Returns
    -------
    pairs : shape (p, 2), indices of truth and estimate, sorted by the first.

    Raises
    ------
    ValueError
        A shape does not fit, a coordinate is not finite, or max_distance is negative or not finite.
    """
    from scipy.optimize import linear_sum_assignment

    truth, estimate = _points(landmarks_truth), _points(landmarks_estimate)
    if not (np.isfinite(max_distance) and max_distance >= 0.0):
        raise ValueError(f"max_distance is {max_distance:g}: expected metres of at least 0")
    distances: Array = np.linalg.norm(truth[:, np.newaxis] - estimate[np.newaxis], axis=2)
    near = distances <= max_distance
    # One pair more is worth any sum of distances.
    apart = (max_distance + 1.0) * (min(distances.shape) + 1.0)
    rows, columns = linear_sum_assignment(np.where(near, distances, apart))
    return np.column_stack([rows, columns])[near[rows, columns]]


def nees(errors: Array, covs: Array) -> Array:
    """Normalised estimation error squared of each estimate: chi-square distributed where its covariance is right.

    Parameters
    ----------
    errors : estimate less truth, shape (n, d).
    covs : claimed, shape (n, d, d).

    Returns
    -------
    ``e^T P^-1 e``, shape (n,); its expected value is d.
    """
    return np.einsum("ki,ki->k", errors, np.linalg.solve(covs, errors[:, :, None])[:, :, 0])


def mean_interval(dof: float, samples: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval that holds the mean of independent chi-square variables with a probability.

    Bar-Shalom, Li and Kirubarajan (2001), section 5.4: the sum is a chi-square variable of ``samples * dof``.

    Parameters
    ----------
    dof : degrees of freedom of each.
    samples : how many there are, at least 1.
    confidence : probability of the interval; both tails are alike.
    """
    from scipy.stats import chi2

    tail = (1.0 - confidence) / 2.0
    low, high = np.asarray(chi2.ppf([tail, 1.0 - tail], samples * dof)) / samples
    return float(low), float(high)


def _points(landmarks: ArrayLike) -> Array:
    points = np.asarray(landmarks, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError(f"landmarks of shape {points.shape}: expected finite metres of shape (n, 2)")
    return points


def motions_between(poses: Array, starts: Indices, ends: Indices) -> Array:
    """Pose of each end in the frame of its start, shape (k, 3) [m, m, rad]."""
    return pose_differences(poses[starts], poses[ends])


def pose_differences(poses_a_b: Array, poses_a_c: Array) -> Array:
    """Pose of c in the frame b, row by row, shape (k, 3) [m, m, rad]."""
    return np.array([between(b, c) for b, c in zip(poses_a_b, poses_a_c, strict=True)])


def magnitudes(poses: Array) -> tuple[Array, Array]:
    """Length of the translations [m] and absolute angles of the rotations [deg]."""
    return np.hypot(poses[:, 0], poses[:, 1]), np.abs(np.rad2deg(poses[:, 2]))


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def span(trajectory: Trajectory) -> str:
    """Count and stamps of a trajectory in words, for messages."""
    if len(trajectory) == 0:
        return "no poses"
    return f"{len(trajectory)} poses, {trajectory.stamps[0]:.3f} to {trajectory.stamps[-1]:.3f} s"
