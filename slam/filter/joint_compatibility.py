# pyright: standard
"""Joint compatibility branch and bound (Neira and Tardos 2001): the largest jointly compatible set of pairings."""

import numpy as np
from numba import f8, i8
from numpy.typing import NDArray

from features.compiled import inner, kernel
from features.se2 import Array

Indices = NDArray[np.int64]


def joint_compatibility(
    corners: Indices, landmarks: Indices, innovations: Array, cov: Array, gates: Array, most_nodes: int
) -> tuple[Indices, float]:
    """Choose among candidate pairings a jointly compatible set: as many pairs as possible, then the smallest distance.

    Parameters
    ----------
    corners, landmarks : of each candidate, shape (m,); candidates of a corner follow one another.
    innovations : of each candidate, shape (m, 2) [m].
    cov : of all innovations together, shape (2 m, 2 m) [m^2].
    gates : limit of the squared Mahalanobis distance of 0, 1, ... pairs together (2 degrees of freedom each), for as
        many pairs as there are corners.
    most_nodes : of the search tree; where they do not suffice the best set so far stands, which is at least the greedy
        one if there are more nodes than corners.

    Returns
    -------
    chosen : candidates, rising, shape (k,); each corner and each landmark at most once.
    distance2 : their squared Mahalanobis distance, 2 k degrees of freedom (eq. M42-M43).

    Raises
    ------
    ValueError
        There are fewer gates than the corners need.
    """
    if len(corners) == 0:
        return np.empty(0, np.int64), 0.0
    starts = np.flatnonzero(np.diff(corners, prepend=-1))
    if len(gates) <= len(starts):
        raise ValueError(f"{len(starts)} corners need {len(starts) + 1} gates, not {len(gates)}")
    return _search(np.append(starts, len(corners)), landmarks, innovations, cov, gates, most_nodes)


@inner()
def _append(factor, white, hypothesis, pairs, candidate, innovations, cov):
    """Append the rows of a candidate to factor and whitened innovations; return what it adds to the distance."""
    added = 0.0
    for axis in range(2):
        row = 2 * pairs + axis
        rest = innovations[candidate, axis]
        diagonal = cov[2 * candidate + axis, 2 * candidate + axis]
        for column in range(row):
            of = 2 * candidate if column >= 2 * pairs else 2 * hypothesis[column // 2]
            entry = cov[2 * candidate + axis, of + column % 2]
            for k in range(column):
                entry -= factor[row, k] * factor[column, k]
            entry /= factor[column, column]
            factor[row, column] = entry
            diagonal -= entry * entry
            rest -= entry * white[column]
        # Not above zero, the root is NaN or the quotient infinite, and the hypothesis ends at its gate.
        factor[row, row] = np.sqrt(diagonal)
        white[row] = rest / factor[row, row]
        added += white[row] * white[row]
    return added


@kernel(i8[::1], i8[:], f8[:, ::1], f8[:, ::1], f8[::1], i8)
def _search(starts, landmarks, innovations, cov, gates, most_nodes):
    """Depth first, each corner with its candidates in turn and last with none.

    A hypothesis carries the Cholesky factor of its innovations' covariance and the whitened innovations, so that one
    pair more costs two rows; what is chosen at a level overwrites what was chosen there before.
    """
    levels = starts.size - 1
    size = 2 * levels
    factor = np.zeros((size, size))
    white = np.zeros(size)
    hypothesis = np.empty(levels, np.int64)
    pairs_at = np.zeros(levels + 1, np.int64)
    distance2_at = np.zeros(levels + 1)
    following = np.empty(levels, np.int64)
    best = np.empty(levels, np.int64)
    best_pairs = 0
    best_distance2 = np.inf
    level = 0
    following[0] = starts[0]
    for _ in range(most_nodes):
        # Every corner that is left could still find its landmark.
        bound = pairs_at[level] + levels - level
        if bound < best_pairs or (bound == best_pairs and distance2_at[level] >= best_distance2):
            following[level] = starts[level + 1] + 1
        if following[level] > starts[level + 1]:
            level -= 1
            if level < 0:
                break
            continue
        candidate = following[level]
        following[level] += 1
        pairs = pairs_at[level]
        distance2 = distance2_at[level]
        if candidate < starts[level + 1]:
            taken = False
            for k in range(pairs):
                taken = taken or landmarks[hypothesis[k]] == landmarks[candidate]
            if taken:
                continue
            distance2 += _append(factor, white, hypothesis, pairs, candidate, innovations, cov)
            if not distance2 <= gates[pairs + 1]:
                continue
            hypothesis[pairs] = candidate
            pairs += 1
        level += 1
        if level == levels:
            if pairs > best_pairs or (pairs == best_pairs and distance2 < best_distance2):
                best_pairs = pairs
                best_distance2 = distance2
                best[:pairs] = hypothesis[:pairs]
            level -= 1
        else:
            pairs_at[level] = pairs
            distance2_at[level] = distance2
            following[level] = starts[level]
    # Fewer nodes than corners lead to no hypothesis at all.
    return best[:best_pairs].copy(), best_distance2 if best_pairs else 0.0
