"""Paths that a robot cannot drive are refused, with the place."""

import numpy as np
import pytest

from sim import Robot, World, WorldError, drive_through

ROOM = World.from_polygons("room", [[(0, 0), (6, 0), (6, 4), (0, 4)], [(2.5, 1.5), (3.5, 1.5), (3.5, 2.5), (2.5, 2.5)]])


def test_a_path_that_is_clear_is_driven():
    trajectory = drive_through(ROOM, [(1.0, 1.0), (5.0, 1.0), (5.0, 3.0)], Robot(), 20.0)
    np.testing.assert_array_equal(trajectory.poses_world_robot[0], [1.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("waypoints", "message"),
    [
        (
            [(1.0, 2.0), (5.0, 2.0)],
            r"path from \(1, 2\) to \(5, 2\) goes through wall 7 from \(2.5, 2.5\) to \(2.5, 1.5\)",
        ),
        ([(5.0, 2.0), (1.0, 2.0)], r"goes through wall 5 from \(3.5, 1.5\) to \(3.5, 2.5\)"),
        ([(0.1, 2.0), (1.0, 2.0)], r"robot starts at \(0.1, 2\), in wall 3"),
        ([(1.0, 1.4), (5.0, 1.4)], r"robot touches wall 4 .* at \(2\.\d+, 1.4\)"),
        ([(1.0, 2.0), (7.0, 2.0)], r"waypoint 1 at \(7, 2\) is outside: the walls reach from \(0, 0\) to \(6, 4\)"),
        ([(1.0, 2.0), (1e300, 2.0)], r"waypoint 1 at \(1e\+300, 2\) is outside"),
        ([(1.0, 2.0), (1.1, 2.0)], "waypoints 0 and 1 are 0.1 m apart"),
        ([(1.0, 2.0)], "at least two"),
        ([(1.0, 2.0), (np.nan, 2.0)], "expected finite waypoints"),
        ([1.0, 2.0], "expected finite waypoints"),
    ],
)
def test_a_path_that_is_none_is_refused_with_its_place(waypoints, message):
    with pytest.raises(WorldError, match=message) as caught:
        drive_through(ROOM, waypoints, Robot(), 20.0)
    assert str(caught.value).startswith("world 'room': ")
