"""Cluttered rooms: closed, passable, the same from the same seed, of every kind of furniture, with true corners."""

from collections import Counter

import numpy as np
import pytest
import shapely

from sim import Robot, World, cluttered_room, drive_through, find_site, findings
from sim.worlds.built_in.furniture import SAGITTA, TURN, arc
from sim.worlds.corners import BLUNT

pytestmark = pytest.mark.slow  # twenty rooms are drawn

SEEDS = range(100, 120)


@pytest.fixture(scope="module")
def rooms():
    return [cluttered_room(seed) for seed in SEEDS]


def polygons(world):
    """Outline and what stands in it, split where a wall does not start at the end of the one before."""
    starts, ends = world.walls[:, :2], world.walls[:, 2:]
    breaks = np.flatnonzero((starts[1:] != ends[:-1]).any(axis=1)) + 1
    return [shapely.Polygon(part) for part in np.split(starts, breaks)]


def kinds(world):
    """Kinds of structure that a room has, from its walls alone."""
    outline, *pieces = polygons(world)
    found = Counter()
    for piece in pieces:
        sides = np.hypot(*np.diff(np.asarray(piece.exterior.coords), axis=0).T)
        thickness = 2.0 * shapely.hausdorff_distance(piece.exterior, piece.centroid)
        if len(sides) == 4:
            low, high = sorted(sides[:2])
            off = piece.distance(outline.exterior)
            found["leaf"] += abs(low - 0.04) < 1e-4 and high > 0.7
            found["square leg"] += low > 0.02 - 1e-4 and high < 0.06 + 1e-4 and high - low < 1e-4
            found["pillar"] += low >= 0.05 - 1e-4 and high <= 0.15 + 1e-4
            found["cupboard"] += low > 0.25 - 1e-4 and 0.05 - 1e-4 <= off <= 0.25 + 1e-4
        elif piece.area > 0.99 * np.pi / 4.0 * thickness**2:
            found["round leg"] += thickness < 0.06
            found["column"] += 0.15 < thickness < 0.81
        else:
            found["curved desk"] += 1
    vertices = np.asarray(outline.exterior.coords)
    lengths = np.hypot(*np.diff(vertices, axis=0).T)
    found["curved wall"] += int((lengths < 0.17).sum() > 10)
    found["niche"] += int(((lengths > 0.08 - 1e-4) & (lengths < 0.2 + 1e-4)).sum() > 1)
    headings = np.degrees(np.arctan2(*np.diff(vertices, axis=0)[lengths > 0.5].T)) % 90.0
    found["oblique wall"] += int(np.ptp(headings) > 2.0)
    return {kind for kind, count in found.items() if count}


def test_same_seed_gives_the_same_room(rooms):
    for seed in SEEDS[:3]:
        np.testing.assert_array_equal(cluttered_room(seed).walls, rooms[seed - SEEDS[0]].walls)
    assert len({world.walls.tobytes() for world in rooms}) == len(rooms)


def test_nothing_is_wrong_with_the_walls(rooms):
    for world in rooms:
        assert findings(world.walls) == []
        outline, *pieces = polygons(world)
        assert outline.is_valid
        assert all(outline.contains_properly(piece) for piece in pieces)


def test_rooms_are_as_large_as_real_ones(rooms):
    for world in rooms:
        assert 12.0 < polygons(world)[0].area < 200.0


def test_what_is_clear_for_a_robot_is_in_one_piece(rooms):
    for world in rooms:
        outline, *pieces = polygons(world)
        clear = outline.difference(shapely.union_all(pieces)).buffer(-0.5)
        parts = [part for part in shapely.get_parts(clear) if part.area > 1e-3]
        assert len(parts) == 1
        assert clear.area > 1.0


def test_twenty_rooms_have_every_kind_and_no_room_has_them_all(rooms):
    counts = Counter(kind for world in rooms for kind in kinds(world))
    assert set(counts) == {
        *("leaf", "square leg", "round leg", "pillar", "cupboard", "column"),
        *("curved desk", "curved wall", "niche", "oblique wall"),
    }
    assert all(count >= 2 for count in counts.values())
    assert max(len(kinds(world)) for world in rooms) >= 8
    assert min(len(kinds(world)) for world in rooms) < 8


def test_corners_are_where_walls_meet_at_an_angle_and_no_joints_of_curves(rooms):
    """Each vertex of a polygon is a corner, or turns by no more than facets do."""
    for world in rooms:
        corners = {tuple(corner) for corner in world.corners.tolist()}
        for polygon in polygons(world):
            vertices = np.asarray(polygon.exterior.coords)[:-1]
            before, after = vertices - np.roll(vertices, 1, axis=0), np.roll(vertices, -1, axis=0) - vertices
            cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
            turns = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
            is_corner = np.array([tuple(vertex) in corners for vertex in vertices.tolist()])
            assert (turns[is_corner] > BLUNT).all()
            assert (turns[~is_corner] < TURN + np.radians(0.5)).all()  # coordinates are rounded to a micrometre


@pytest.mark.parametrize("radius", [0.01, 0.4, 3.0])
def test_facets_of_an_arc_are_as_near_to_it_as_stated(radius):
    points = arc(np.array([1.0, 2.0]), radius, 0.3, 2.8)
    middles = (points[1:] + points[:-1]) / 2.0
    assert (radius - np.hypot(*(middles - [1.0, 2.0]).T)).max() <= SAGITTA
    np.testing.assert_allclose(np.hypot(*(points - [1.0, 2.0]).T), radius)


def test_a_round_column_has_no_corner():
    column = World.from_polygons("column", [arc(np.zeros(2), 0.02, 0.0, 2.0 * np.pi)[:-1]])
    assert len(column.corners) == 0


def test_a_robot_gets_along_the_tour_of_a_room():
    for seed in (3, 22, 25):
        site = find_site(f"cluttered-room-{seed}")
        assert site.name == f"cluttered-room-{seed}"
        drive_through(site.world(), site.waypoints, Robot(), 10.0)
