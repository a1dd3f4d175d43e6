"""The true corner of each observed one."""

import numpy as np

from features import extract, sensor_preset
from features.se2 import pose, transform
from sim import Lidar, World, label_corners, room

SQUARE = World.from_polygons("square", [[(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)]])


def test_corners_of_the_room_are_known_again():
    """Of every corner that is extracted somewhere in the room, the truth is one corner, within six sigma of it."""
    scanner, sensor, rng = Lidar.of_preset("rplidar-s1"), sensor_preset("rplidar-s1"), np.random.default_rng(0)
    labelled = set()
    for _ in range(20):
        place = pose(*rng.uniform([1.2, 1.2, -3.0], [2.4, 2.6, 3.0]))
        found = scanner.measure(room(), place, 0.0, rng)
        corners = extract(found.scan, sensor).corners
        positions = transform(place, corners.positions)
        labels = label_corners(room(), found.wall_ids, positions, 0.3)
        assert (labels >= 0).all()
        error = positions - room().corners[labels]
        turn = np.array([[np.cos(place[2]), -np.sin(place[2])], [np.sin(place[2]), np.cos(place[2])]])
        covs = turn @ corners.covs @ turn.T
        assert np.einsum("ki,kij,kj->k", error, np.linalg.inv(covs), error).max() < 36.0
        labelled |= set(labels.tolist())
    assert len(labelled) > 5


def test_an_observation_far_from_every_corner_is_of_none():
    every_wall = np.arange(4)
    positions = np.array([[0.05, -0.05], [2.0, 2.0], [3.9, 4.0]])
    expected = [int(np.hypot(*(SQUARE.corners - corner).T).argmin()) for corner in ((0.0, 0.0), (4.0, 4.0))]
    assert label_corners(SQUARE, every_wall, positions, 0.2).tolist() == [expected[0], -1, expected[1]]


def test_a_corner_counts_only_where_both_of_its_walls_were_hit():
    """Walls 0 and 1 meet at (4, 0); beams without a wall do not count for the last one."""
    positions = SQUARE.corners.copy()
    labels = label_corners(SQUARE, np.array([0, 1, -1, 0]), positions, 0.1)
    assert [SQUARE.corners[label].tolist() for label in labels if label >= 0] == [[4.0, 0.0]]
    assert (label_corners(SQUARE, np.array([-1, 2]), positions, 0.1) == -1).all()
    assert label_corners(SQUARE, np.array([-1]), np.empty((0, 2)), 0.1).shape == (0,)
