# pyright: standard
"""Compiled steps of multi-hypothesis association, on one EKF per hypothesis."""

import math

import numpy as np
from numba import b1, f8, i8

from features.compiled import inner, kernel
from features.se2_kernels import compound
from slam.filter.ekf import POSE_DIM


@inner()
def _apply(block, to, at):
    """Product of a row of the derivative with a vector or the columns of a matrix."""
    return block[0] * to[0] + block[1] * to[1] + block[2] * to[2] + block[3] * to[at] + block[4] * to[at + 1]


@inner()
def _differentiate(state, at, blocks):
    """Landmark at a place of a state as seen from its pose; ``blocks``, shape (2, 5), becomes the derivative (M15)."""
    c, s = math.cos(state[2]), math.sin(state[2])
    across, along = state[at] - state[0], state[at + 1] - state[1]
    x, y = c * across + s * along, c * along - s * across
    blocks[0, 0], blocks[0, 1], blocks[0, 2], blocks[0, 3], blocks[0, 4] = -c, -s, y, c, s
    blocks[1, 0], blocks[1, 1], blocks[1, 2], blocks[1, 3], blocks[1, 4] = s, -c, -x, -s, c
    return x, y


@kernel(f8[:, ::1], f8[:, :, ::1], i8[::1], f8[::1], f8[:, ::1])
def move(states, covs, counts, motion, motion_cov):
    """Predict each filter, in place (eq. M13).

    Parameters
    ----------
    states, covs : of each filter, shapes (h, d) and (h, d, d); what lies behind its landmarks is not looked at.
    counts : landmarks of each filter, shape (h,).
    motion, motion_cov : shapes (3,) and (3, 3).
    """
    for h in range(len(counts)):
        size = 2 * counts[h]
        pose, cov = states[h, :POSE_DIM], covs[h, : POSE_DIM + size, : POSE_DIM + size]
        crosses = cov[:POSE_DIM, POSE_DIM:].copy().reshape((1, POSE_DIM, size))
        pose[:], cov[:POSE_DIM, :POSE_DIM], _ = compound(
            pose, cov[:POSE_DIM, :POSE_DIM].copy(), crosses, motion, motion_cov
        )
        cov[:POSE_DIM, POSE_DIM:] = crosses[0]
        cov[POSE_DIM:, :POSE_DIM] = crosses[0].T


@kernel(f8[:, ::1], f8[:, :, ::1], i8[::1], b1[:, ::1], f8[::1], f8[:, ::1], f8)
def score(states, covs, counts, taken, position, position_cov, new):
    """Log-likelihood of an observation as each landmark of each filter, or as a new one (eq. M60).

    Parameters
    ----------
    states, covs, counts : as for :func:`move`.
    taken : whether another observation of the same moment is this landmark, shape (h, n).
    position, position_cov : of the observation, robot frame, shapes (2,) and (2, 2).
    new : log-likelihood of a new landmark.

    Returns
    -------
    Shape (h, n + 1); a new landmark is the one behind a filter's last, what cannot be is minus infinity.
    """
    found = np.full((taken.shape[0], taken.shape[1] + 1), -np.inf)
    blocks = np.empty((2, 5))
    for h in range(len(counts)):
        state, cov = states[h], covs[h]
        for landmark in range(counts[h]):
            if taken[h, landmark]:
                continue
            at = POSE_DIM + 2 * landmark
            x, y = _differentiate(state, at, blocks)
            u, v = position[0] - x, position[1] - y
            aa, ab, bb = position_cov[0, 0], position_cov[0, 1], position_cov[1, 1]
            for i in range(5):
                row = i if i < POSE_DIM else at + i - POSE_DIM
                for j in range(5):
                    entry = cov[row, j if j < POSE_DIM else at + j - POSE_DIM]
                    aa += blocks[0, i] * entry * blocks[0, j]
                    ab += blocks[0, i] * entry * blocks[1, j]
                    bb += blocks[1, i] * entry * blocks[1, j]
            det = aa * bb - ab * ab
            distance2 = (bb * u * u - 2.0 * ab * u * v + aa * v * v) / det
            found[h, landmark] = -0.5 * (distance2 + math.log(det)) - math.log(2.0 * math.pi)
        found[h, counts[h]] = new
    return found


@kernel(f8[:, ::1], f8[:, :, ::1], i8[::1], i8[::1], i8[::1], f8[::1], f8[:, ::1])
def branch(states, covs, counts, parents, landmarks, position, position_cov):
    """Update copies of ``parents``, shape (k,), with an observation of ``landmarks``, shape (k,).

    A landmark behind the parent's last is new (eq. M16-M17); there is room for it. Parameters as for :func:`score`.

    Returns
    -------
    states, covs, counts : of the new filters.
    """
    size = states.shape[1]
    states_after, covs_after = np.empty((len(parents), size)), np.empty((len(parents), size, size))
    counts_after = counts[parents]
    blocks = np.empty((2, 5))
    for k in range(len(parents)):
        used = POSE_DIM + 2 * counts_after[k]
        at = POSE_DIM + 2 * landmarks[k]
        state, cov = states[parents[k], :used], covs[parents[k], :used, :used]
        state_after, cov_after = states_after[k], covs_after[k]
        if at < used:
            x, y = _differentiate(state, at, blocks)
            # The covariance of the innovation is L L'; what it takes off the state's is (L^-1 H P)' (L^-1 H P).
            first, second = _apply(blocks[0], cov, at), _apply(blocks[1], cov, at)
            root = math.sqrt(position_cov[0, 0] + _apply(blocks[0], first, at))
            below = (position_cov[0, 1] + _apply(blocks[0], second, at)) / root
            first /= root
            rest = math.sqrt(position_cov[1, 1] + _apply(blocks[1], second, at) - below * below)
            second = (second - below * first) / rest
            u = (position[0] - x) / root
            v = (position[1] - y - below * u) / rest
            state_after[:used] = state + u * first + v * second
            for row in range(used):
                cov_after[row, :used] = cov[row] - first[row] * first - second[row] * second
            continue
        c, s = math.cos(state[2]), math.sin(state[2])
        arm_x, arm_y = c * position[0] - s * position[1], s * position[0] + c * position[1]
        state_after[:used], cov_after[:used, :used] = state, cov
        state_after[used], state_after[used + 1] = state[0] + arm_x, state[1] + arm_y
        cov_after[used, :used] = cov[0] - arm_y * cov[2]
        cov_after[used + 1, :used] = cov[1] + arm_x * cov[2]
        cov_after[:used, used : used + 2] = cov_after[used : used + 2, :used].T
        turn = np.array([[c, -s], [s, c]])
        own = turn @ position_cov @ turn.T
        for axis in range(2):
            row = cov_after[used + axis]
            own[axis, 0] += row[0] - arm_y * row[2]
            own[axis, 1] += row[1] + arm_x * row[2]
        cov_after[used : used + 2, used : used + 2] = 0.5 * (own + own.T)
        counts_after[k] += 1
    return states_after, covs_after, counts_after
