"""Random rooms and places in them: valid by shapely, the same from the same seed, and of every kind promised."""

import numpy as np
import pytest
import shapely

from sim import World, WorldError, random_pose, random_room, room

SEEDS = range(50)


@pytest.fixture(scope="module")
def rooms():
    return [random_room(seed) for seed in SEEDS]


def polygons(world):
    """Outline and pillars, split where a wall does not start at the end of the one before."""
    starts, ends = world.walls[:, :2], world.walls[:, 2:]
    breaks = np.flatnonzero((starts[1:] != ends[:-1]).any(axis=1)) + 1
    return [shapely.Polygon(part) for part in np.split(starts, breaks)]


def free_space(world):
    outline, *pillars = polygons(world)
    return outline.difference(shapely.union_all(pillars))


def test_same_seed_gives_the_same_room(rooms):
    for seed in SEEDS[:10]:
        again = random_room(seed)
        assert again.name == rooms[seed].name
        np.testing.assert_array_equal(again.walls, rooms[seed].walls)


def test_seeds_give_different_rooms(rooms):
    assert len({world.walls.tobytes() for world in rooms}) == len(rooms)


def test_walls_do_not_cross(rooms):
    for world in rooms:
        outline, *pillars = polygons(world)
        assert outline.is_valid
        for k, pillar in enumerate(pillars):
            assert pillar.is_valid
            assert outline.contains(pillar)
            # A robot of 0.7 m passes on either side.
            assert all(pillar.distance(other) >= 0.75 for other in [outline.exterior, *pillars[:k]])


def test_walls_that_share_no_vertex_keep_apart(rooms):
    """0.3 m: a niche narrower than that would be a crack."""
    for world in rooms:
        lines = [shapely.LineString(wall.reshape(2, 2)) for wall in world.walls]
        gaps = [a.distance(b) for k, a in enumerate(lines) for b in lines[:k]]
        assert all(gap == 0.0 or gap > 0.3 for gap in gaps)
        assert gaps.count(0.0) == len(lines)


def test_free_space_is_in_one_piece(rooms):
    assert all(free_space(world).geom_type == "Polygon" for world in rooms)


def test_sizes_walls_and_corners_are_as_promised(rooms):
    for world in rooms:
        extent = np.ptp(world.walls.reshape(-1, 2), axis=0)
        assert ((extent >= 4.0) & (extent <= 12.0)).all()
        assert np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T).min() >= 0.4 - 1e-9
        opening_deg = np.degrees(world.opening_angles)
        assert len(opening_deg) == len(world.walls)
        assert ((opening_deg >= 60.0) & (opening_deg <= 140.0)).all()


def test_rooms_are_of_every_kind(rooms):
    """Without pillars and with four, plain and with many niches, square and odd corners."""
    assert {len(polygons(world)) - 1 for world in rooms} == {0, 1, 2, 3, 4}
    vertices = [len(polygons(world)[0].exterior.coords) - 1 for world in rooms]
    assert min(vertices) <= 8
    assert max(vertices) >= 20
    opening_deg = np.degrees(np.concatenate([world.opening_angles for world in rooms]))
    odd = np.abs(opening_deg - 90.0) > 1.0
    assert 0.15 < odd.mean() < 0.5
    assert opening_deg.min() < 65.0
    assert opening_deg.max() > 135.0


def test_poses_are_free_and_clear(rooms):
    for seed, world in enumerate(rooms):
        rng = np.random.default_rng(seed)
        free = free_space(world)
        for clearance in (0.4, 0.4, 0.4, 0.1, 0.6):
            place = shapely.Point(random_pose(world, rng, clearance)[:2])
            assert free.contains(place)
            assert free.boundary.distance(place) >= clearance - 1e-9


def test_poses_reach_all_of_the_free_space():
    """Their mean and headings are those of the uniform density, in a room with a pillar."""
    world = World.from_polygons(
        "pillar", [[(0, 0), (6, 0), (6, 4), (0, 4)], [(1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0)]]
    )
    rng = np.random.default_rng(5)
    poses = np.array([random_pose(world, rng, 0.0) for _ in range(3000)])
    centroid = np.array(free_space(world).centroid.coords[0])
    # Standard error of a mean: at most 2 m / sqrt(3000) = 0.04 m; four of them.
    np.testing.assert_allclose(poses[:, :2].mean(axis=0), centroid, atol=0.15)
    assert np.hypot(np.cos(poses[:, 2]).mean(), np.sin(poses[:, 2]).mean()) < 0.08
    assert ((poses[:, 2] >= -np.pi) & (poses[:, 2] < np.pi)).all()


def test_same_generator_gives_the_same_pose():
    draws = [random_pose(room(), np.random.default_rng(4)) for _ in range(2)]
    np.testing.assert_array_equal(*draws)


def test_no_place_is_an_error():
    with pytest.raises(WorldError, match="'room': found no place 5 m clear of every wall"):
        random_pose(room(), np.random.default_rng(0), clearance=5.0)
