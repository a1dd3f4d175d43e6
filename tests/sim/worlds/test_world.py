"""Worlds of polygons: their walls, their corners, and what is refused."""

import math

import numpy as np
import pytest

from features.errors import CwlfError
from sim import World, WorldError

SQUARE = [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]


def sorted_rows(points):
    return points[np.lexsort(points.T)]


def test_polygon_is_closed():
    """The last vertex is joined to the first."""
    walls = World.from_polygons("square", [SQUARE]).walls
    assert walls.shape == (4, 4)
    np.testing.assert_array_equal(walls[:, 2:], np.roll(walls[:, :2], -1, axis=0))


def test_corners_of_polygons_are_their_vertices_with_their_opening_angle():
    triangle = [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0)]
    world = World.from_polygons("two", [SQUARE, triangle])
    np.testing.assert_array_equal(sorted_rows(world.corners), sorted_rows(np.array(SQUARE + triangle)))
    expected = [math.pi / 2.0] * 5 + [math.pi / 4.0] * 2
    np.testing.assert_allclose(world.opening_angles, expected, atol=1e-12)


def test_reflex_vertex_opens_by_less_than_half_a_turn():
    """The opening angle is the one between the walls, on whichever side it is."""
    world = World.from_polygons("ell", [[(0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4)]])
    np.testing.assert_allclose(world.opening_angles, math.pi / 2.0, atol=1e-12)


def test_straight_vertex_is_no_corner():
    world = World.from_polygons("square", [[(0.0, 0.0), (2.0, 0.0), *SQUARE[1:]]])
    assert len(world.walls) == 5
    np.testing.assert_array_equal(sorted_rows(world.corners), sorted_rows(np.array(SQUARE)))


def test_vertex_on_a_third_wall_is_no_corner():
    """A cabinet that stands against a wall keeps only the corners that face the room; so do two that share a vertex."""
    cabinet = [(1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)]
    neighbour = [(2.0, 1.0), (3.0, 1.0), (3.0, 2.0), (2.0, 2.0)]
    world = World.from_polygons("against", [SQUARE, cabinet, neighbour])
    expected = np.array([*SQUARE, (1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (2.0, 2.0)])
    np.testing.assert_array_equal(sorted_rows(world.corners), sorted_rows(expected))


def test_ends_of_a_single_wall_are_no_corners():
    world = World("wall", np.array([[0.0, 0.0, 1.0, 0.0]]))
    assert world.corners.shape == (0, 2)
    assert world.opening_angles.shape == (0,)


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        ([], "at least one polygon"),
        ([SQUARE, [(0.0, 0.0), (1.0, 0.0)]], "polygon 1: expected at least 3 vertices, got 2"),
        ([[(0.0, 0.0, 0.0)] * 3], r"polygon 0: expected vertices of shape \(n, 2\)"),
        ([SQUARE, [(0.0, 0.0), (1.0, math.nan), (1.0, 1.0)]], "polygon 1: vertex 1 is .* finite"),
        ([[(0.0, 0.0), (1.0, 0.0), (1.0, math.inf)]], "polygon 0: vertex 2 is .* finite"),
        ([[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]], "polygon 0: vertices 1 and 2 are the same"),
        ([[*SQUARE, SQUARE[0]]], "polygon 0: vertices 4 and 0 are the same"),
    ],
)
def test_bad_polygon_is_named(polygons, message):
    """The error says which polygon and which vertex."""
    with pytest.raises(WorldError, match=message) as caught:
        World.from_polygons("bad", polygons)
    assert isinstance(caught.value, CwlfError)


@pytest.mark.parametrize(
    ("walls", "message"),
    [
        (np.empty((0, 4)), "n >= 1"),
        (np.ones((2, 2)), r"shape \(n, 4\)"),
        (np.array([[0.0, 0.0, 1.0, 0.0], [0.0, np.nan, 1.0, 0.0]]), "wall 1 .* not finite"),
        (np.array([[1.0, 2.0, 1.0, 2.0]]), "wall 0 has no length"),
    ],
)
def test_bad_wall_is_named(walls, message):
    with pytest.raises(WorldError, match=message):
        World("bad", walls)


def test_walls_of_a_corner_end_at_it():
    """Ascending, and as far apart as the opening angle says."""
    triangle = [(1.0, 1.0), (3.0, 1.0), (1.0, 3.0)]
    world = World.from_polygons("two", [SQUARE, triangle])
    np.testing.assert_array_equal(world.corner_walls, [[0, 3], [0, 1], [1, 2], [2, 3], [4, 6], [4, 5], [5, 6]])
    for corner, opening_angle, pair in zip(world.corners, world.opening_angles, world.corner_walls, strict=True):
        ends = world.walls[pair].reshape(2, 2, 2)
        at = np.hypot(*(ends - corner).transpose(2, 0, 1))
        assert (at.min(axis=1) == 0.0).all()
        first, second = (ends[k, at[k].argmax()] - corner for k in range(2))
        cosine = first @ second / np.hypot(*first) / np.hypot(*second)
        assert math.acos(cosine) == pytest.approx(opening_angle, abs=1e-12)


def test_glass_is_flagged_wall_by_wall():
    walls = World.from_polygons("square", [SQUARE]).walls
    assert not World("clear", walls).glass.any()
    np.testing.assert_array_equal(World("glazed", walls, np.arange(4) == 2).glass, [False, False, True, False])
    with pytest.raises(WorldError, match=r"4 walls, but flags of glass of shape \(3,\)"):
        World("short", walls, np.ones(3, dtype=bool))
