"""What loop closing takes for the same place, and the count of what it found.

What depends on the building is configured; docs/math.md has the reason of each value here.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from features.se2 import Array
from slam.odometry.rules import RegistrationRules


@dataclass(frozen=True, slots=True)
class PlaceRules:
    """When constellations of corners are alike (eq. M52-M53).

    Parameters
    ----------
    same_distance : corners of one submap, of one kind and signature, that are nearer than this are one [m].
    same_angle : how far orientations and opening angles of one corner may differ [rad].
    shortest_pair : two corners nearer to each other than this make no pair [m].
    pair_tolerance : how far the lengths of a pair on two visits may differ [m].
    corner_tolerance : how far a corner may lie off its place in a constellation of another visit [m].
    votes : pairs, at least, that put the robot at one place.
    vote_distance, vote_turn : how far these pairs may differ in where they put it [m, rad].
    corners : corners, at least, in which two constellations agree.
    fits : how often the fit of two constellations is made with the corners that coincide.
    """

    same_distance: float = 0.3
    same_angle: float = math.radians(25.0)
    shortest_pair: float = 1.0
    pair_tolerance: float = 0.3
    corner_tolerance: float = 0.4
    votes: int = 3
    vote_distance: float = 0.5
    vote_turn: float = math.radians(10.0)
    corners: int = 4
    fits: int = 2


@dataclass(frozen=True, slots=True)
class WallSearchRules:
    """How a place is searched for by walls (eq. M55-M57).

    Parameters
    ----------
    spacing : path length between two searches [m].
    submap : path length whose walls are searched for [m].
    cell : width of a cell of the grid, and how far a point may lie from a wall [m].
    levels : times that the width of a block is doubled.
    most_points : points of the submap that are searched for, at most.
    most_nodes : blocks of poses whose score is bounded in one search, at most.
    rival : share of the score of the best pose that none elsewhere may have.
    same_position, same_heading : poses nearer than this to the best one are the same place [m, rad].
    supporters : least number of supporting key frames.
    through : share of the beams of any key frame of the newest submap that may go through walls of the place.
    """

    spacing: float = 4.0
    submap: float = 4.0
    cell: float = 0.2
    levels: int = 4
    most_points: int = 300
    most_nodes: int = 40_000
    rival: float = 0.9
    same_position: float = 1.0
    same_heading: float = math.radians(10.0)
    supporters: int = 4
    through: float = 0.1


@dataclass(frozen=True, slots=True)
class LoopRules:
    """Thresholds for proposing and verifying loop closures.

    Parameters
    ----------
    registration, places, walls : rules of the parts.
    spacing : path length between two searches for a closure [m].
    memory : path length from a search to the one that may confirm it, at most [m].
    submap_length : path length whose walls, before and behind a key frame, are put together [m].
    reactivation : path length, before and behind a recognised key frame, whose landmarks become active again [m].
    sigma : largest standard deviation of the position in its least certain direction [m].
    agree_position, agree_heading : how far two corrections in a row may differ [m, rad].
    constellation : path length whose corners make a constellation [m].
    overlap : constellations that a stretch of the path belongs to.
    supporters : least number of supporting key frames for a place proposed by its constellation.
    supporter_spacing : path length between those that are tried [m].
    unknown_position, unknown_heading : sigma of where a hypothesis puts the robot [m, rad].
    possible : probability that dead reckoning lies as near to a hypothesis that is right as it has to.
    blur_position, blur_heading : sigma of a place by its corners, and of what dead reckoning does not know of itself
        [m, rad].
    broken : sigma of a motion beyond which key frames before and after it make no submap [m].
    systematic_position, systematic_heading : sigma of the errors that all registrations of a place share [m, rad].
    """

    registration: RegistrationRules = RegistrationRules(gate=1.0)  # noqa: RUF009, frozen
    places: PlaceRules = PlaceRules()
    walls: WallSearchRules = WallSearchRules()
    spacing: float = 0.5
    memory: float = 2.0
    submap_length: float = 8.0
    reactivation: float = 16.0
    sigma: float = 0.05
    agree_position: float = 0.3
    agree_heading: float = math.radians(4.0)
    constellation: float = 16.0
    overlap: int = 3
    supporters: int = 3
    supporter_spacing: float = 1.0
    unknown_position: float = 1.0
    unknown_heading: float = math.radians(10.0)
    possible: float = 0.9999
    blur_position: float = 0.3
    blur_heading: float = math.radians(3.0)
    broken: float = 0.3
    systematic_position: float = 0.005
    systematic_heading: float = math.radians(0.125)

    @property
    def possible_gate(self) -> float:
        """Squared Mahalanobis distance from dead reckoning beyond which a hypothesis is dropped (eq. M51, M64)."""
        return float(chi2.ppf(self.possible, 3))

    @property
    def unknown_cov(self) -> Array:
        """Covariance of where a hypothesis puts the robot, in its axes, shape (3, 3)."""
        return np.diag([self.unknown_position, self.unknown_position, self.unknown_heading]) ** 2

    @property
    def blur_cov(self) -> Array:
        """Covariance of a place by its corners, and what dead reckoning does not know of itself, shape (3, 3)."""
        return np.diag([self.blur_position, self.blur_position, self.blur_heading]) ** 2

    @property
    def systematic_cov(self) -> Array:
        """Covariance that all registrations of a place share, shape (3, 3) (eq. M48)."""
        return np.diag([self.systematic_position, self.systematic_position, self.systematic_heading]) ** 2


@dataclass(slots=True)
class LoopCounts:
    """What became of the hypotheses that a place is seen again.

    Parameters
    ----------
    proposed_near, proposed_by_corners, proposed_by_walls : by where the robot believes to be, by constellations of
        corners, and by walls over the region that dead reckoning allows for.
    accepted : closures that entered the graph.
    rejected : hypotheses that did not: no walls to fit, no second search that agrees, or more than one place that fits.
    revoked : closures that the graph has left out in the end.
    """

    proposed_near: int = 0
    proposed_by_corners: int = 0
    proposed_by_walls: int = 0
    accepted: int = 0
    rejected: int = 0
    revoked: int = 0
