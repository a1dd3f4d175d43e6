"""Stand-ins for the environments A and B of section V of the paper, which gives only their sizes and counts."""

from features.se2 import Pose, pose
from sim.worlds.world import World

_A_OUTLINE = [
    (0.0, 0.0),
    (1.6, 0.0),
    (1.6, 0.8),
    (2.7, 0.8),
    (2.7, 0.0),
    (6.2, 0.0),
    (6.2, 0.7),
    (7.4, 0.7),
    (7.4, 0.0),
    (9.0, 0.0),
    (9.0, 1.3),
    (8.1, 1.3),
    (8.1, 2.2),
    (9.0, 2.2),
    (9.0, 6.0),
    (7.57, 7.2),
    (5.9, 7.2),
    (5.9, 8.0),
    (2.9, 8.0),
    (2.9, 7.2),
    (0.0, 7.2),
    (0.0, 6.0),
    (0.9, 6.0),
    (0.9, 5.3),
    (0.0, 5.3),
    (0.0, 2.2),
    (0.9, 2.2),
    (0.9, 1.3),
    (0.0, 1.3),
]
_A_PILLARS = [
    [(4.25, 1.2), (4.65, 1.65), (4.2, 2.05), (3.8, 1.6)],
    [(7.0, 3.3), (7.4, 3.7), (7.0, 4.1), (6.6, 3.7)],
    [(4.4, 5.65), (4.8, 5.95), (4.5, 6.35), (4.1, 6.05)],
    [(1.9, 3.4), (2.3, 3.7), (2.0, 4.1), (1.6, 3.8)],
]

_B_OUTLINE = [
    (0.7, 0.0),
    (3.0, 0.0),
    (3.0, 1.9),
    (3.5, 1.9),
    (3.5, 3.6),
    (3.0, 3.6),
    (3.0, 4.8),
    (2.3, 4.8),
    (2.3, 6.0),
    (0.0, 6.0),
    (0.0, 3.88),
    (0.5, 3.88),
    (0.5, 3.4),
    (0.0, 3.4),
    (0.0, 0.9),
    (0.7, 0.9),
]
_B_PILLAR = [(1.75, 0.85), (2.15, 1.15), (1.85, 1.55), (1.45, 1.25)]

ENVIRONMENT_A_POSE: Pose = pose(4.4, 3.9, -0.55)
"""Pose of the sensor in :func:`environment_a`, world frame, shape (3,) [m, m, rad]."""

ENVIRONMENT_B_POSE: Pose = pose(1.8, 2.8, -2.2)
"""Pose of the sensor in :func:`environment_b`, world frame, shape (3,) [m, m, rad]."""

for _pose in (ENVIRONMENT_A_POSE, ENVIRONMENT_B_POSE):
    _pose.flags.writeable = False


def environment_a() -> World:
    """Make a stand-in for environment A: 9 m by 8 m, cabinets along the walls, a niche, four pillars and a chamfer.

    From :data:`ENVIRONMENT_A_POSE` a scan of 920 beams shows 36 straight sections, each of at least 8 beams and 0.4 m,
    no smaller ones, and 23 corners where two of them meet. Number 20, clockwise from the heading of the sensor, opens
    by 130 deg and its neighbour 19 by 140 deg; all others are square.
    """
    return World.from_polygons("environment-a", [_A_OUTLINE, *_A_PILLARS])


def environment_b() -> World:
    """Make a stand-in for environment B: 3.5 m by 6 m, walls that step in, a niche, a cabinet and a pillar.

    From :data:`ENVIRONMENT_B_POSE` a scan of 920 beams shows 18 straight sections, each of at least 8 beams and 0.4 m,
    no smaller ones, and 15 corners where two of them meet, all square. Number 4, clockwise from the heading of
    the sensor, is a corner of the room whose walls are seen for more than 1.5 m each.
    """
    return World.from_polygons("environment-b", [_B_OUTLINE, _B_PILLAR])
