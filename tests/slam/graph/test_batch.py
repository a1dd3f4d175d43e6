"""Leaving measurements out of a least-squares problem, against solving it again without them."""

import numpy as np
import pytest

from slam.graph.batch import outliers

GATE = 21.1


def problem(seed, wrong):
    """Whitened rows of a linear problem: twelve that are certain, and six measurements of three rows, some wrong."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(0.0, 1.0, (12 + 18, 6))
    truth = rng.normal(0.0, 5.0, 6)
    measured = jacobian @ truth + rng.normal(0.0, 1.0, 30)
    for k in wrong:
        measured[12 + 3 * k : 15 + 3 * k] += rng.choice([-20.0, 20.0], 3)
    return jacobian, measured


def solved(jacobian, measured, without=()):
    kept = np.ones(len(measured), np.bool_)
    for k in without:
        kept[12 + 3 * k : 15 + 3 * k] = False
    x = np.linalg.lstsq(jacobian[kept], measured[kept])[0]
    return x, float(((measured - jacobian @ x)[kept] ** 2).sum())


def found(jacobian, measured, gate=GATE):
    x, _ = solved(jacobian, measured)
    cov = np.linalg.inv(jacobian.T @ jacobian)
    rows = jacobian[12:]
    return outliers((measured - jacobian @ x)[12:], rows @ cov @ rows.T, gate)


def by_solving_again(jacobian, measured):
    """The same, each time by solving without each of those that are left."""
    out = []
    while len(out) < 6:
        cost = solved(jacobian, measured, out)[1]
        gains = {k: cost - solved(jacobian, measured, [*out, k])[1] for k in range(6) if k not in out}
        worst = max(gains, key=gains.__getitem__)
        if out and gains[worst] <= GATE:
            break
        out.append(worst)
        if gains[worst] <= GATE:
            break
    return out


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("wrong", [[], [2], [1, 4], [0, 3, 5]])
def test_those_are_left_out_that_solving_again_would_leave_out(seed, wrong):
    jacobian, measured = problem(seed, wrong)
    assert found(jacobian, measured) == by_solving_again(jacobian, measured)


@pytest.mark.parametrize("seed", range(5))
def test_the_wrong_ones_are_found(seed):
    assert sorted(found(*problem(seed, [1, 4]))) == [1, 4]


def test_where_none_is_beyond_the_gate_the_worst_one_is_named():
    jacobian, measured = problem(0, [])
    cost = solved(jacobian, measured)[1]
    worst = max(range(6), key=lambda k: cost - solved(jacobian, measured, [k])[1])
    assert found(jacobian, measured, 1e6) == [worst]
