"""People beside the way of a robot: clear of it and of the walls, and where the robot sees them."""

import numpy as np
import pytest
import shapely

from sim import EFFECTS, Lidar, World, WorldError, find_site, people_beside, site_run


@pytest.mark.slow
@pytest.mark.parametrize("name", ["room", "apartment", "office-loop"])
def test_people_touch_neither_walls_nor_the_robot_wherever_they_are(name):
    """Distances by shapely between where they are over ten minutes and walls and the way of the robot."""
    run = site_run(find_site(name), Lidar.of_preset("rplidar-s1"), "rplidar-s1", 3, people=5)
    assert len(run.people) == 5
    walls = shapely.MultiLineString(list(run.world.walls.reshape(-1, 2, 2)))
    # Within a millimetre of the poses, which are hundreds to a metre.
    way = shapely.LineString(run.poses_world_robot[:, :2]).simplify(1e-3, preserve_topology=False)
    for person in run.people:
        places = shapely.points(person.at(np.arange(0.0, 600.0, 0.1)))
        assert shapely.distance(places, walls).min() >= person.radius - 1e-3
        assert shapely.distance(places, way).min() >= person.radius + 0.15 - 2e-2  # the way is simplified by 1 cm


@pytest.mark.slow
def test_the_lidar_sees_them_and_the_seed_decides_where_they_go():
    def run(seed):
        return site_run(find_site("room"), Lidar.of_preset("rplidar-s1"), "rplidar-s1", seed, people=2)

    met = {person for measured in run(1).measurements() for person in measured.person_ids.tolist()}
    assert met == {-1, 0, 1}
    paths = [[person.path.tolist() for person in run(seed).people] for seed in (1, 1, 2)]
    assert paths[0] == paths[1] != paths[2]


def test_people_and_effects_change_nothing_of_the_odometry():
    lidar = Lidar.of_preset("rplidar-s1", effects=EFFECTS["rplidar-s1"])
    plain = site_run(find_site("room"), Lidar.of_preset("rplidar-s1"), "rplidar-s1", 1)
    crowded = site_run(find_site("room"), lidar, "rplidar-s1", 1, people=2)
    np.testing.assert_array_equal(plain.poses_odom_robot, crowded.poses_odom_robot)


def test_where_there_is_no_room_it_says_so():
    narrow = World.from_polygons("narrow", [[(0.0, 0.0), (9.0, 0.0), (9.0, 1.0), (0.0, 1.0)]])
    way = np.array([[1.0, 0.5, 0.0], [8.0, 0.5, 0.0]])
    with pytest.raises(WorldError, match="no room for a person"):
        people_beside(narrow, way, 1, np.random.default_rng(0))
