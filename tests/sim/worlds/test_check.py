"""What is found wrong with walls: nothing in a closed outline, and each defect by its kind and place."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from features.se2 import rotation
from sim import findings, random_room
from sim.worlds.check import open_ends

SQUARE = np.array([(0, 0, 4, 0), (4, 0, 4, 4), (4, 4, 0, 4), (0, 4, 0, 0)], dtype=np.float64)


def with_walls(*walls):
    return np.vstack([SQUARE, np.array(walls, dtype=np.float64)])


def test_a_closed_outline_is_right():
    assert findings(SQUARE) == []


def test_walls_that_end_on_another_one_are_right():
    """A partition that ends in the middle of two walls, and a third wall at a vertex."""
    assert findings(with_walls((2, 0, 2, 4), (0, 0, 2, 2))) == []


@pytest.mark.parametrize(
    ("walls", "expected"),
    [
        (with_walls((1, 1, 1, 1)), ["wall 4 has no length: (1, 1) to (1, 1)"]),
        (with_walls((1, np.nan, 1, 1)), ["wall 4 has a coordinate that is not finite: (1, nan) to (1, 1)"]),
        (with_walls((1, 1, 1, np.inf)), ["wall 4 has a coordinate that is not finite: (1, 1) to (1, inf)"]),
        (with_walls((4, 4, 4, 0)), ["walls 1 and 4 are the same: (4, 0) to (4, 4)"]),
        (
            with_walls((1, 0, 3, 0)),
            ["walls 0 and 4 lie on each other over 2 m: (0, 0) to (4, 0) and (1, 0) to (3, 0)"],
        ),
        (
            with_walls((2, -1, 2, 2)),
            [
                "walls 0 and 4 cross at (2, 0)",
                "wall 4 ends at (2, -1) and meets no other there",
                "wall 4 ends at (2, 2) and meets no other there",
            ],
        ),
        (with_walls((0, 0, 2, 3)), ["wall 4 ends at (2, 3) and meets no other there"]),
        (
            with_walls((1, 1, 2, 2)),
            ["wall 4 ends at (1, 1) and meets no other there", "wall 4 ends at (2, 2) and meets no other there"],
        ),
        (SQUARE[:3], ["an outline of 3 walls is not closed: it is open from (0, 0) to (0, 4), 4 m"]),
        (
            np.vstack([SQUARE[:3], [(0, 4, 0, 0.02)]]),
            ["an outline of 4 walls is not closed: it is open from (0, 0) to (0, 0.02), 0.02 m"],
        ),
    ],
)
def test_a_defect_is_named_with_its_place(walls, expected):
    assert findings(walls) == expected


def test_a_dead_end_at_an_outline_is_told_from_a_gap():
    """Two walls that end in the room, each on its own: closing one by the other would make no outline."""
    found = open_ends(with_walls((0, 2, 1, 2), (4, 2, 3, 2)))
    assert len(found) == 2
    assert all("meets no other" in line for line in found)


@settings(derandomize=True, deadline=None)
@given(
    st.integers(0, 10_000),
    st.floats(-np.pi, np.pi),
    hnp.arrays(np.float64, 2, elements=st.floats(-1000.0, 1000.0)),
)
def test_a_room_is_right_wherever_it_lies(seed, turn, shift):
    """Rounding by a shift of a kilometre is 1e-13 m, far below what counts as a gap."""
    walls = (random_room(seed).walls.reshape(-1, 2) @ rotation(turn).T + shift).reshape(-1, 4)
    assert findings(walls) == []


@pytest.mark.slow
@settings(derandomize=True, deadline=None)
@given(st.integers(0, 1000), st.data())
def test_a_room_that_lost_a_wall_is_open_where_it_was(seed, data):
    walls = random_room(seed).walls
    lost = data.draw(st.integers(0, len(walls) - 1))
    (line,) = findings(np.delete(walls, lost, axis=0))
    assert "is not closed" in line
    gap = np.hypot(*(walls[lost, 2:] - walls[lost, :2]))
    assert float(line.split()[-2]) == pytest.approx(gap, rel=1e-5)


@settings(derandomize=True, deadline=None)
@given(hnp.arrays(np.float64, (6, 4), elements=st.integers(-3, 3).map(float)))
def test_crossings_are_those_of_exact_arithmetic(walls):
    """Whole coordinates: sides are whole numbers, and two walls cross where each parts the ends of the other."""

    def side(wall, point):
        return np.sign((wall[2] - wall[0]) * (point[1] - wall[1]) - (wall[3] - wall[1]) * (point[0] - wall[0]))

    expected = {
        (i, j)
        for i in range(6)
        for j in range(i + 1, 6)
        if side(walls[i], walls[j, :2]) * side(walls[i], walls[j, 2:]) < 0
        and side(walls[j], walls[i, :2]) * side(walls[j], walls[i, 2:]) < 0
    }
    found = {tuple(map(int, line.split()[1:4:2])) for line in findings(walls) if " cross at " in line}
    assert found == expected
