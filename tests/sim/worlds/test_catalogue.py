"""Built-in worlds: what is promised of each, and that a robot gets along its path."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from sim import BUILT_IN, Robot, WorldError, drive_through, find_site, findings, random_room

NAMES = [*BUILT_IN, "random-room-1", "random-room-13"]


@pytest.fixture(scope="module", params=NAMES)
def site(request):
    return find_site(request.param)


def test_nothing_is_wrong_with_it(site):
    assert findings(site.walls) == []


@pytest.mark.slow
def test_the_robot_gets_along_the_path_and_touches_nothing(site):
    """Against the distance to points laid every centimetre on every wall, which shapely has no part in."""
    poses = drive_through(site.world(), site.waypoints, Robot(), 10.0).poses_world_robot
    points = [
        wall[:2] + share * (wall[2:] - wall[:2])
        for wall in site.walls
        for share in np.linspace(0.0, 1.0, 2 + int(np.hypot(*(wall[2:] - wall[:2])) / 0.01))[:, None]
    ]
    distances, _ = cKDTree(np.vstack(points)).query(poses[:, :2])
    assert distances.min() > 0.15
    np.testing.assert_allclose(poses[-1, :2], site.waypoints[-1], atol=0.2)


def test_every_vertex_is_a_corner(site):
    """Outlines that close and touch nothing else have as many corners as walls."""
    world = site.world()
    assert len(world.corners) == len(world.walls)


def test_the_name_of_a_world_is_the_one_it_is_found_by(site):
    assert find_site(site.name).name == site.name


def rooms(site):
    """Parts into which the free space falls where it is shrunk by more than half a doorway of 0.9 m."""
    space = shapely.union_all([shapely.Polygon(face) for face in polygons(site)[:1]])
    for hole in polygons(site)[1:]:
        space = shapely.difference(space, shapely.Polygon(hole))
    return [part for part in shapely.get_parts(space.buffer(-0.5).buffer(0.2)) if part.area > 0.5]


def polygons(site):
    """Rings of vertices of a world of closed polygons, the largest first."""
    lines = shapely.union_all([shapely.LineString(wall.reshape(2, 2)) for wall in site.walls])
    return sorted(
        (face.exterior for face in shapely.get_parts(shapely.polygonize([lines]))),
        key=lambda r: -shapely.Polygon(r).area,
    )


@pytest.mark.parametrize(("name", "count"), [("apartment", 7), ("large-office", 73)])
def test_the_path_enters_every_room(name, count):
    """Six rooms and the hall; 72 rooms and the corridors."""
    site = find_site(name)
    path = shapely.LineString(site.waypoints)
    found = rooms(site)
    assert len(found) == count
    assert all(path.intersects(room) for room in found)


def test_the_office_loop_is_large_and_has_two_loops():
    site = find_site("office-loop")
    world = site.world()
    extent = np.ptp(world.walls.reshape(-1, 2), axis=0)
    assert (extent >= (60.0, 30.0)).all()
    assert len(world.corners) >= 100
    _, *holes = polygons(site)
    assert len(holes) == 2
    # A loop has been closed around a hole where the path surrounds it.
    path = shapely.LineString(site.waypoints)
    surrounded = shapely.union_all(shapely.get_parts(shapely.polygonize([shapely.union_all([path])])))
    assert all(surrounded.buffer(1.0).contains(shapely.Polygon(hole)) for hole in holes)


def test_the_large_office_has_more_than_a_thousand_walls():
    assert len(find_site("large-office").walls) >= 1000


def test_a_random_room_is_the_one_of_its_seed():
    np.testing.assert_array_equal(find_site("random-room-7").walls, random_room(7).walls)
    np.testing.assert_array_equal(find_site("random-room-7").waypoints, find_site("random-room-7").waypoints)


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_gets_along_the_tour_of_any_random_room(seed):
    site = find_site(f"random-room-{seed}")
    drive_through(site.world(), site.waypoints, Robot(), 10.0)


@pytest.mark.parametrize("name", ["palace", "random-room-", "random-room--1", "random-room-x"])
def test_an_unknown_name_lists_the_known_ones(name):
    with pytest.raises(WorldError, match="office-loop") as caught:
        find_site(name)
    assert repr(name) in str(caught.value)
