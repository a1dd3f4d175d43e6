"""Corners found through the tree of the walls, against a plain search of every point among every wall."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sim import World, random_room
from sim.worlds.corners import BLUNT, STRAIGHT, TOUCH


def plain_corners(walls):
    """Corner points, opening angles and pairs of walls, in the order in which the walls mention them."""
    starts, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
    found = []
    points = walls.reshape(-1, 2)
    for index, point in enumerate(points):
        if (np.hypot(*(points[:index] - point).T) <= TOUCH).any():
            continue
        share = np.clip(((point - starts) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        meets = np.flatnonzero(np.hypot(*(starts + share[:, None] * along - point).T) <= TOUCH)
        at_end = np.minimum(share, 1.0 - share) * np.hypot(*along.T) <= TOUCH
        if len(meets) == 2 and at_end[meets].all():
            first, second = (along[k] if share[k] < 0.5 else -along[k] for k in meets)
            opening = abs(np.arctan2(first[0] * second[1] - first[1] * second[0], first @ second))
            if STRAIGHT < opening < np.pi - BLUNT:
                found.append((point, opening, meets))
    return found


def assert_same_corners(world):
    expected = plain_corners(world.walls)
    np.testing.assert_array_equal(world.corners, np.array([point for point, _, _ in expected]).reshape(-1, 2))
    np.testing.assert_allclose(world.opening_angles, [opening for _, opening, _ in expected], rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(world.corner_walls, np.array([pair for _, _, pair in expected]).reshape(-1, 2))


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(2, 5))
@settings(derandomize=True, deadline=None, max_examples=60)
def test_equals_the_plain_search_where_walls_meet_in_every_way(seed, size):
    """On the points of a small grid they share ends, cross, run on in a line, and end on one another."""
    rng = np.random.default_rng(seed)
    walls = rng.integers(0, size, (20, 4)).astype(float)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    assert_same_corners(World("grid", walls))


def test_equals_the_plain_search_in_random_rooms():
    for seed in range(10):
        assert_same_corners(random_room(seed))
