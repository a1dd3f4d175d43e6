"""Joint compatibility: branch and bound against all hypotheses, one by one, and against what it is for."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from scipy.stats import chi2

from slam.filter.joint_compatibility import joint_compatibility
from slam.filter.rules import FilterRules

NODES = FilterRules().most_nodes
GATES = np.concatenate([[0.0], chi2.ppf(0.99, 2 * np.arange(1, 12))])


def exhaustive(corners, landmarks, innovations, cov):
    """Best over every choice of one candidate, or none, for each corner."""
    groups = [[None, *np.flatnonzero(corners == corner)] for corner in np.unique(corners)]
    best = ([], 0.0)
    for choice in itertools.product(*groups):
        chosen = [c for c in choice if c is not None]
        if len(set(landmarks[chosen])) < len(chosen):
            continue
        rows = [2 * c + axis for c in chosen for axis in (0, 1)]
        h = innovations[chosen].ravel()
        distance2 = float(h @ np.linalg.solve(cov[np.ix_(rows, rows)], h)) if chosen else 0.0
        if distance2 <= GATES[len(chosen)] and (-len(chosen), distance2) < (-len(best[0]), best[1]):
            best = (chosen, distance2)
    return best


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5), st.integers(1, 4), st.floats(0.3, 4.0))
def test_the_best_of_all_hypotheses_is_found(seed, corner_count, landmark_count, spread):
    """No smaller hypothesis inside its gate is missed where a larger one goes through one outside: as the search does.

    A pair once outside the gate stays out: the distance of more pairs is never smaller, but its gate is larger. So the
    oracle is held against the search only where every beginning of its best hypothesis is inside its gate.
    """
    rng = np.random.default_rng(seed)
    pairs = [(c, j) for c in range(corner_count) for j in range(landmark_count) if rng.uniform() < 0.7]
    corners, landmarks = np.array(pairs, np.int64).reshape(-1, 2).T
    m = len(pairs)
    root = rng.normal(size=(2 * m, 2 * m + 3))
    cov = root @ root.T
    innovations = spread * (root @ rng.normal(size=2 * m + 3)).reshape(-1, 2)
    chosen, distance2 = joint_compatibility(corners, landmarks, innovations, cov, GATES, NODES)
    assert len(set(corners[chosen])) == len(set(landmarks[chosen])) == len(chosen)
    rows = [2 * c + axis for c in chosen for axis in (0, 1)]
    h = innovations[chosen].ravel()
    expected_distance2 = h @ np.linalg.solve(cov[np.ix_(rows, rows)], h) if len(chosen) else 0.0
    np.testing.assert_allclose(distance2, expected_distance2, rtol=1e-6, atol=1e-9)
    assert distance2 <= GATES[len(chosen)]
    best, best_distance2 = exhaustive(corners, landmarks, innovations, cov)
    beginnings = [best[:k] for k in range(1, len(best) + 1)]
    inside = True
    for beginning in beginnings:
        part = [2 * c + axis for c in beginning for axis in (0, 1)]
        h = innovations[beginning].ravel()
        inside = inside and h @ np.linalg.solve(cov[np.ix_(part, part)], h) <= GATES[len(beginning)]
    if inside:
        assert len(chosen) == len(best)
        np.testing.assert_allclose(distance2, best_distance2, rtol=1e-6, atol=1e-9)
    else:
        assert len(chosen) <= len(best)


def test_a_common_shift_explains_what_each_pair_alone_would_explain_otherwise():
    """Three corners seen 0.5 m to the side by a robot that is unsure of itself: the nearest landmark is a wrong one."""
    landmarks = np.array([[0.0, 0.0], [0.6, 0.0], [3.0, 1.0], [5.0, -2.0]])
    seen = landmarks[[0, 2, 3]] + [0.5, 0.0]
    corners, candidates = (index.ravel() for index in np.indices((3, 4)))
    innovations = (seen[:, None] - landmarks[None]).reshape(-1, 2)
    near = np.hypot(*innovations.T) < 1.0
    corners, candidates, innovations = corners[near], candidates[near], innovations[near]
    m = len(corners)
    cov = np.kron(np.ones((m, m)), 0.3**2 * np.eye(2)) + 0.02**2 * np.eye(2 * m)
    chosen, _ = joint_compatibility(corners, candidates, innovations, cov, GATES, NODES)
    np.testing.assert_array_equal(candidates[chosen], [0, 2, 3])


def test_many_corners_that_fit_everywhere_end_in_time_with_a_valid_set():
    """Ten corners, ten landmarks, all alike: a hypothesis with every corner comes out."""
    corners, landmarks = (index.ravel() for index in np.indices((10, 10)))
    rng = np.random.default_rng(0)
    innovations = rng.normal(0.0, 0.1, (100, 2))
    chosen, _ = joint_compatibility(corners, landmarks, innovations, np.eye(200), GATES, NODES)
    assert len(chosen) == 10
    assert len(set(landmarks[chosen])) == 10


def test_nothing_to_choose_from():
    none = np.empty(0, np.int64)
    chosen, distance2 = joint_compatibility(none, none, np.empty((0, 2)), np.empty((0, 0)), GATES, NODES)
    assert len(chosen) == 0
    assert distance2 == 0.0


def everything_admitted(count, rng):
    """As many corners as landmarks, every pair a candidate: corners and landmarks of the candidates."""
    corners, landmarks = (index.ravel() for index in np.indices((count, count)))
    return corners, landmarks, rng.normal(size=(count * count, 2))


@pytest.mark.parametrize("seed", range(6))
def test_the_best_of_many_hypotheses_is_found_where_the_search_takes_thousands_of_nodes(seed):
    """Six corners that may be any of six landmarks, with innovations that are correlated, against all 720 ways.

    The worst way of all is scaled to the gate of a single pair, so that no gate ends a branch: only distances do.
    """
    rng = np.random.default_rng(seed)
    corners, landmarks, innovations = everything_admitted(6, rng)
    root = rng.normal(size=(72, 90)) / 9.0
    cov = root @ root.T
    ways = 6 * np.arange(6) + np.array(list(itertools.permutations(range(6))))
    rows = (2 * ways[:, :, None] + np.arange(2)).reshape(len(ways), 12)
    h = innovations.ravel()[rows]
    distances2 = np.einsum("wi,wi->w", h, np.linalg.solve(cov[rows[:, :, None], rows[:, None]], h[..., None])[..., 0])
    scale = 0.99 * GATES[1] / distances2.max()
    chosen, distance2 = joint_compatibility(corners, landmarks, math.sqrt(scale) * innovations, cov, GATES, NODES)
    np.testing.assert_array_equal(chosen, ways[distances2.argmin()])
    np.testing.assert_allclose(distance2, scale * distances2.min(), rtol=1e-9)
    # Six nodes lead to the first way of all, and no more are looked at.
    first, _ = joint_compatibility(corners, landmarks, math.sqrt(scale) * innovations, cov, GATES, 30)
    assert len(first) == 6
    assert first.tolist() != chosen.tolist()


@pytest.mark.parametrize("seed", range(6))
def test_where_the_search_is_not_completed_its_result_is_at_least_the_greedy_one(seed):
    """Fourteen corners that may be most of fourteen landmarks: more ways than any search could try.

    Innovations are independent, so that scipy's assignment knows the best way; it is held against it to show that the
    search has indeed ended before. The greedy one gives each corner in turn its first landmark that holds together with
    those before.
    """
    rng = np.random.default_rng(seed)
    corners, landmarks, innovations = everything_admitted(14, rng)
    innovations *= 0.8
    kept = rng.random(len(corners)) < 0.9
    corners, landmarks, innovations = corners[kept], landmarks[kept], innovations[kept]
    gates = chi2.ppf(0.99, np.maximum(2 * np.arange(15), 1))
    own = (innovations**2).sum(axis=1)
    greedy: list[int] = []
    for corner in range(14):
        for candidate in np.flatnonzero(corners == corner):
            taken = landmarks[candidate] in landmarks[greedy]
            if not taken and own[[*greedy, candidate]].sum() <= gates[len(greedy) + 1]:
                greedy.append(candidate)
                break
    chosen, distance2 = joint_compatibility(corners, landmarks, innovations, np.eye(2 * len(own)), gates, NODES)
    assert len(set(corners[chosen])) == len(set(landmarks[chosen])) == len(chosen)
    np.testing.assert_allclose(distance2, own[chosen].sum(), rtol=1e-9)
    assert distance2 <= gates[len(chosen)]
    assert (-len(chosen), distance2) <= (-len(greedy), own[greedy].sum() * (1.0 + 1e-9))
    costs = np.full((14, 14), 1e3)
    costs[corners, landmarks] = own
    best = costs[linear_sum_assignment(costs)].sum()
    assert best < distance2 or len(chosen) < 14


def test_gates_that_do_not_suffice_for_the_corners_are_refused():
    corners, landmarks = np.arange(12), np.arange(12)
    with pytest.raises(ValueError, match="12 corners need 13 gates, not 12"):
        joint_compatibility(corners, landmarks, np.zeros((12, 2)), np.eye(24), GATES, NODES)
