"""Geometric hashing: places are recognised by pairs of corners, independent of the estimated pose of the robot."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from features.se2 import Array, Pose, rotate_each, wrap_angle
from slam.loop.constellation import Constellation, fit_constellation
from slam.loop.rules import PlaceRules

Admit = Callable[[NDArray[np.int64], Array], NDArray[np.bool_]]
"""Whether the robot may be there: from the places, shape (h,), and its poses in their frames, shape (h, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A place where the robot may be.

    Parameters
    ----------
    place : its number, in the order in which the places were added.
    pose_place_robot : shape (3,).
    count : corners that are the same.
    """

    place: int
    pose_place_robot: Pose
    count: int


class GeometricHash:
    """Places that were seen, indexed by the geometry of their pairs of corners.

    A pair is known by its length, and by the kinds, opening angles and bisectors of its corners, these relative to it:
    nothing of that depends on where the robot believes to be.

    Parameters
    ----------
    rules : when constellations are alike.
    """

    def __init__(self, rules: PlaceRules = PlaceRules()) -> None:  # noqa: B008, frozen
        self._rules = rules
        self._places: list[Constellation] = []
        self._pairs: list[Array] = []
        self._tree: KDTree | None = None

    def __len__(self) -> int:
        return len(self._places)

    def __getstate__(self) -> dict[str, Any]:
        # The tree and what goes with it are made again when they are asked for.
        return {"_rules": self._rules, "_places": self._places, "_pairs": self._pairs, "_tree": None}

    def add(self, constellation: Constellation) -> None:
        """Remember a place by its constellation, given in its frame."""
        first, second = np.nonzero(~np.eye(len(constellation), dtype=np.bool_))
        self._places.append(constellation)
        self._pairs.append(_pairs(constellation, first, second, self._rules))
        self._tree = None

    def propose(self, constellation: Constellation, admit: Admit) -> list[Proposal]:
        """Look for places on which a constellation, robot frame, lies with enough corners (eq. M52-M53).

        Returns
        -------
        The best of each place, that with the most corners first.
        """
        rules = self._rules
        places, poses = self._hypotheses(_pairs(constellation, *np.triu_indices(len(constellation), 1), rules))
        admitted = admit(places, poses) if len(places) else np.zeros(0, np.bool_)
        places, poses = places[admitted], poses[admitted]
        votes = self._votes(places, poses, constellation.positions)
        best: dict[int, Proposal] = {}
        tried: set[int] = set()
        for at in np.argsort(-votes, kind="stable").tolist():
            place = int(places[at])
            if votes[at] < rules.votes:
                break
            if place in tried:
                continue
            tried.add(place)
            same = np.flatnonzero(places == place)
            start = _mean_of_voters(poses[same], poses[at], constellation.positions.mean(axis=0), rules)
            pose_place_robot, count = fit_constellation(constellation, self._places[place], start, rules)
            if count >= rules.corners:
                best[place] = Proposal(place, pose_place_robot, count)
        return sorted(best.values(), key=lambda proposal: -proposal.count)

    def _hypotheses(self, here: Array) -> tuple[NDArray[np.int64], Array]:
        """Places with a pair alike, shape (h,), and the pose of the robot in its frame by this pair, shape (h, 3)."""
        tree = self._tree
        if tree is None:
            self._known = np.concatenate([*self._pairs, np.empty((0, PAIR_FIELDS))])
            self._place_of = np.repeat(np.arange(len(self._pairs)), [len(pairs) for pairs in self._pairs])
            tree = self._tree = KDTree(self._known[:, SIGNATURE:])
        alike = cast(Sequence[list[int]], tree.query_ball_point(here[:, SIGNATURE:], 1.0, p=np.inf))
        mine = np.repeat(np.arange(len(here)), [len(each) for each in alike])
        theirs = np.array([pair for each in alike for pair in each], np.int64)
        seen, known = here[mine], self._known[theirs]
        turns = wrap_angle(known[:, DIRECTION] - seen[:, DIRECTION])
        return self._place_of[theirs], np.column_stack([known[:, :2] - rotate_each(seen[:, :2], turns), turns])

    def _votes(self, places: NDArray[np.int64], poses: Array, corners: Array) -> NDArray[np.int64]:
        """Count the hypotheses of the same place whose pose agrees with each one, itself included, shape (h,)."""
        if not len(places):
            return np.zeros(0, np.int64)
        middles = poses[:, :2] + rotate_each(np.tile(corners.mean(axis=0), (len(poses), 1)), poses[:, 2])
        chord = 2.0 * math.sin(self._rules.vote_turn / 2.0)
        turns = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1) / chord
        ballots = np.column_stack([FAR_APART * places, middles / self._rules.vote_distance, turns])
        return np.asarray(KDTree(ballots).query_ball_point(ballots, 1.0, p=np.inf, return_length=True))


DIRECTION, SIGNATURE, PAIR_FIELDS = 2, 3, 12
"""A pair of corners: its middle, direction from the first to the second, and what does not depend on the frame."""

FAR_APART = 10.0
"""What keeps kinds apart in a tree whose tolerance is 1."""


def _pairs(corners: Constellation, first: NDArray[np.int64], second: NDArray[np.int64], rules: PlaceRules) -> Array:
    """Pairs of corners, shape (k, PAIR_FIELDS); what is alike differs by 1 at most in each field of the signature."""
    arms = corners.positions[second] - corners.positions[first]
    lengths = np.hypot(arms[:, 0], arms[:, 1])
    kept = lengths >= rules.shortest_pair
    first, second, arms, lengths = first[kept], second[kept], arms[kept], lengths[kept]
    directions = np.arctan2(arms[:, 1], arms[:, 0])
    middles = 0.5 * (corners.positions[first] + corners.positions[second])
    fields = [middles, directions, lengths / rules.pair_tolerance]
    # Angles as points of a circle, where those that differ by the tolerance are one apart.
    radius = 0.5 / math.sin(rules.same_angle / 2.0)
    for at in (first, second):
        signatures = corners.signatures[at]
        bisectors = signatures.orientations - directions
        fields += [radius * np.cos(bisectors), radius * np.sin(bisectors)]
        fields += [signatures.opening_angles / rules.same_angle, FAR_APART * signatures.kinds]
    # A point has no angles: it is the middle of that circle, and only its kind distinguishes it from a corner.
    return np.nan_to_num(np.column_stack(fields), nan=0.0)


def _mean_of_voters(poses: Array, elected: Pose, middle: Array, rules: PlaceRules) -> Pose:
    """Mean of those hypotheses of one place, shape (h, 3), that put the middle of the corners where the elected does.

    A single pair of corners near to each other may err by more than a corner is allowed to.
    """
    middles = poses[:, :2] + rotate_each(np.tile(middle, (len(poses), 1)), poses[:, 2])
    elected_middle = elected[:2] + rotate_each(middle[None], elected[2:])[0]
    turns = wrap_angle(poses[:, 2] - float(elected[2]))
    voters = (np.abs(middles - elected_middle) <= rules.vote_distance).all(axis=1) & (np.abs(turns) <= rules.vote_turn)
    turn = elected[2:] + turns[voters].mean()
    x, y = middles[voters].mean(axis=0) - rotate_each(middle[None], turn)[0]
    return np.array([x, y, wrap_angle(float(turn[0]))])
