"""The room: what a lidar can see in it, and the path through it."""

import numpy as np
import pytest
import shapely

from sim import Robot, room, room_waypoints


@pytest.fixture(scope="module")
def path():
    """Drive through the room; true poses, shape (n, 3), one a second."""
    return Robot().drive(room_waypoints(), 50.0).poses_world_robot[::50]


def test_room_is_ten_by_eight_with_free_standing_things():
    world = room()
    points = world.walls.reshape(-1, 2)
    np.testing.assert_array_equal(points.min(axis=0), [0.0, 0.0])
    np.testing.assert_array_equal(points.max(axis=0), [10.0, 8.0])
    outline, *things = shapely.get_parts(shapely.polygonize([shapely.LineString(w.reshape(2, 2)) for w in world.walls]))
    assert len(things) == 3
    assert all(shapely.Polygon(outline.exterior).contains(thing) for thing in things)


def test_every_vertex_of_the_room_is_a_corner():
    world = room()
    assert len(world.corners) == len(world.walls)
    opening_deg = np.degrees(world.opening_angles)
    assert np.isclose(opening_deg, 130.0).sum() == 1
    assert np.isclose(opening_deg, 90.0).sum() >= 20


def test_walls_of_the_room_are_long_enough_for_a_corner():
    """Each is 0.6 m or more: 20 beams of the RPLIDAR at 4.4 m."""
    walls = room().walls
    assert np.hypot(*(walls[:, 2:] - walls[:, :2]).T).min() >= 0.6


def test_path_keeps_clear_of_the_walls(path):
    walls = shapely.multilinestrings([wall.reshape(2, 2) for wall in room().walls])
    assert shapely.distance(walls, shapely.LineString(path[:, :2])) > 0.5


def test_path_is_closed_and_goes_round_as_often_as_asked():
    once, thrice = room_waypoints(1), room_waypoints(3)
    np.testing.assert_array_equal(once[0], once[-1])
    np.testing.assert_array_equal(thrice[: len(once)], once)
    assert len(thrice) == 3 * (len(once) - 1) + 1


def test_path_needs_a_round():
    with pytest.raises(ValueError, match="rounds is 0"):
        room_waypoints(0)


def test_path_sees_every_wall(path):
    """Some scan has at least 20 of the RPLIDAR's 920 beams on each wall."""
    world = room()
    angles = np.linspace(-np.pi, np.pi, 920, endpoint=False)
    beams = np.array([np.bincount(world.cast(pose, angles)[1], minlength=len(world.walls)) for pose in path])
    assert beams.max(axis=0).min() >= 20
