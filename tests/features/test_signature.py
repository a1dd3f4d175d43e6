"""Signatures: which corners may be the same one, whatever the frame and the order that they are given in."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from laws import law

from features.se2 import wrap_angle
from features.signature import Kind, Signatures, alike

OPENING, ORIENTATION = math.radians(20.0), math.radians(30.0)
ANGLES = st.floats(-math.pi, math.pi)
SEEDS = st.integers(0, 2**32 - 1)


def one(kind=Kind.CONCAVE, opening_angle=1.5, orientation=0.3):
    return Signatures(np.array([kind]), np.array([opening_angle]), np.array([orientation]))


def some(seed, count=6):
    """Corners of both kinds and points, with few angles, so that many are alike."""
    rng = np.random.default_rng(seed)
    corners = Signatures(
        rng.integers(0, 2, count), rng.choice([1.0, 1.2, 1.6], count), rng.choice([-3.1, -2.8, 0.1, 0.3, 3.0], count)
    )
    return Signatures.concatenate([corners, Signatures.of_points(2)])[rng.permutation(count + 2)]


def same(first, second):
    return bool(alike(first, second, OPENING, ORIENTATION)[0])


@pytest.mark.parametrize(
    ("other", "expected"),
    [
        (one(), True),
        (one(opening_angle=1.5 + 0.99 * OPENING), True),
        (one(opening_angle=1.5 - 1.01 * OPENING), False),
        (one(orientation=0.3 - 0.99 * ORIENTATION), True),
        (one(orientation=0.3 + 1.01 * ORIENTATION), False),
        (one(orientation=0.3 - 4.0 * math.pi), True),
        (one(Kind.CONVEX), False),
        (Signatures.of_points(1), False),
    ],
)
def test_corners_of_one_kind_with_similar_angles_are_alike(other, expected):
    assert same(one(), other) == same(other, one()) == expected


def test_points_are_alike():
    assert alike(Signatures.of_points(3)[:, None], Signatures.of_points(2), OPENING, ORIENTATION).all()


@law
@given(ANGLES, ANGLES, ANGLES)
def test_turning_both_changes_nothing(first, second, angle):
    assume(abs(abs(wrap_angle(first - second)) - ORIENTATION) > 1e-9)
    before, after = one(orientation=first), one(orientation=second)
    assert same(before, after) == same(before.turned(angle), after.turned(angle))


@law
@given(SEEDS, SEEDS)
def test_a_table_of_pairs_says_of_each_pair_what_the_pair_alone_does(seed, other_seed):
    rows, columns = some(seed), some(other_seed)
    table = alike(rows[:, None], columns, OPENING, ORIENTATION)
    assert table.shape == (len(rows), len(columns))
    for i in range(len(rows)):
        for j in range(len(columns)):
            assert table[i, j] == same(rows[[i]], columns[[j]])


@law
@given(SEEDS)
def test_what_is_put_together_is_found_again_by_index(seed):
    parts = some(seed), some(seed + 1)
    both = Signatures.concatenate(parts)
    count = len(parts[0])
    assert len(both) == count + len(parts[1])
    for part, index in ((parts[0], slice(count)), (parts[1], np.arange(count, len(both)))):
        for name in ("kinds", "opening_angles", "orientations"):
            np.testing.assert_array_equal(getattr(both[index], name), getattr(part, name))


def cross(one, other):
    return one[0] * other[1] - one[1] * other[0]


@pytest.mark.parametrize("kind", [Kind.CONCAVE, Kind.CONVEX])
@given(st.floats(0.6, 2.6), st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi), st.floats(0.0, 0.25))
def test_a_corner_is_faced_where_the_lines_of_sight_meet_both_walls_by_more_than_grazing(
    kind, opening, orientation, direction, grazing
):
    """Against the angles from the line of sight to the two walls, which run away from the sensor at a convex corner."""
    walls = orientation + np.array([-0.5, 0.5]) * opening
    place = np.array([math.cos(direction), math.sin(direction)])
    along = np.stack([np.cos(walls), np.sin(walls)])
    inner = np.array([math.cos(orientation), math.sin(orientation)])
    sides = cross(along, place) * np.sign(cross(along, inner))
    # Inside the angle of a concave corner; opposite to it, outside of both walls, at a convex one.
    sines = sides if kind == Kind.CONCAVE else -sides
    ahead = place @ inner if kind == Kind.CONCAVE else -place @ inner
    assume(abs(sines - math.sin(grazing)).min() > 1e-6)
    assume(abs(ahead) > 1e-6)
    expected = ahead > 0.0 and (sines > math.sin(grazing)).all()
    found = Signatures(np.array([kind]), np.array([opening]), np.array([orientation])).faced(
        np.array([direction]), grazing
    )
    assert found.tolist() == [expected]


def test_a_point_is_faced_from_everywhere():
    assert Signatures.of_points(3).faced(np.array([0.0, 2.0, -1.0]), 0.2).all()
