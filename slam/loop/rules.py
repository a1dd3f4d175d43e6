"""What loop closing takes for the same place, and the count of what it found."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LoopRules:
    """What counts as the same place.

    Parameters
    ----------
    apart : path length between two visits of a place [m].
    spacing : path length between two searches for a closure [m].
    reach : distance between key frames that may show the same place [m].
    submap_length : path length whose walls, before and behind a key frame, are put together [m].
    share : of the points of a scan those that lie on walls of the submap, at least.
    sigma : largest standard deviation of the position in its least certain direction [m].
    agree_position, agree_heading : how far two corrections in a row may differ [m, rad].
    constellation : path length whose corners make a constellation [m].
    corners : corners, at least, in which two constellations agree.
    supporters : key frames of a constellation, at least, that have to fit the walls of the other alike.
    supporter_spacing : path length between those that are tried [m].
    """

    apart: float = 15.0
    spacing: float = 0.5
    reach: float = 5.0
    submap_length: float = 8.0
    share: float = 0.6
    sigma: float = 0.05
    agree_position: float = 0.3
    agree_heading: float = math.radians(4.0)
    constellation: float = 16.0
    corners: int = 4
    supporters: int = 3
    supporter_spacing: float = 1.0


@dataclass(slots=True)
class LoopCounts:
    """What became of the hypotheses that a place is seen again.

    Parameters
    ----------
    proposed_near, proposed_by_corners : by where the robot believes to be, and by constellations of corners.
    accepted : closures that entered the graph.
    rejected : hypotheses that did not: no walls to fit, no second search that agrees, or more than one place that fits.
    revoked : closures that the graph has left out in the end.
    """

    proposed_near: int = 0
    proposed_by_corners: int = 0
    accepted: int = 0
    rejected: int = 0
    revoked: int = 0
