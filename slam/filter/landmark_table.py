"""What is known of each landmark beside the filter's state: signature, counts, and its place while it is inactive."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, rotate_each
from features.signature import Signatures

Indices = NDArray[np.int64]

ACTIVE, MERGED, REMOVED = -1, -2, -3
"""Status in place of an anchor key frame: in the filter's state, merged into another landmark, or removed."""


@dataclass(frozen=True, slots=True)
class LandmarkCounts:
    """Counts of landmarks by their status.

    Parameters
    ----------
    born : all landmarks that were initialised.
    tentative : not seen often enough yet to be on the map.
    confirmed : seen often enough.
    pruned : removed, as they had more misses than observations; tentative and confirmed ones.
    seldom_seen : removed, as they were seen in too few of the scans that had their places in sight.
    merged : found to be another one.
    rested, woken : number of deactivations and reactivations.
    """

    born: int
    tentative: int
    confirmed: int
    pruned: int
    seldom_seen: int
    merged: int
    rested: int
    woken: int


class LandmarkTable:
    """Every landmark by its index.

    A landmark is active (in the filter's state) or inactive: stored relative to its anchor, the last key frame that
    observed it, so that it moves with this key frame when the graph is corrected.

    Attributes
    ----------
    kinds : a :class:`features.signature.Kind` each, shape (n,).
    identities : by which the source knows each, -1 for none, shape (n,).
    observations : times each was seen, shape (n,).
    misses : times each should have been seen, but the beams went through its place, shape (n,).
    overlooked : times its place was in sight, but no corner was found there, shape (n,).
    farthest : largest distance from which each was seen, shape (n,) [m].
    key_frames : anchor of an inactive landmark, or :data:`ACTIVE`, :data:`MERGED`, :data:`REMOVED`,
        shape (n,).
    anchors : key frame that saw each landmark last, :data:`ACTIVE` where none has yet, shape (n,).
    headings : of the robot at the anchor, in the frame of the orientations of active landmarks, shape
        (n,) [rad].
    positions, covs : as seen from the anchor, robot frame, shapes (n, 2) [m] and (n, 2, 2) [m^2].
    """

    def __init__(self) -> None:
        self._sums: Array = np.empty((0, 3))
        self.kinds: Indices = np.empty(0, np.int64)
        self.identities: Indices = np.empty(0, np.int64)
        self.observations: Indices = np.empty(0, np.int64)
        self.misses: Indices = np.empty(0, np.int64)
        self.overlooked: Indices = np.empty(0, np.int64)
        self.farthest: Array = np.empty(0)
        self.key_frames: Indices = np.empty(0, np.int64)
        self.anchors: Indices = np.empty(0, np.int64)
        self.headings: Array = np.empty(0)
        self.positions: Array = np.empty((0, 2))
        self.covs: Array = np.empty((0, 2, 2))
        self._rested = self._woken = self._seldom_seen = 0

    def __len__(self) -> int:
        return self.observations.size

    def signatures(self, landmarks: Indices | None = None) -> Signatures:
        """Kinds and mean angles of landmarks, all by default; world frame, of an inactive one that of its anchor."""
        chosen = slice(None) if landmarks is None else landmarks
        sums, observations = self._sums[chosen], self.observations[chosen]
        return Signatures(self.kinds[chosen], sums[:, 0] / observations, np.arctan2(sums[:, 2], sums[:, 1]))

    def signatures_world(self, landmarks: Indices, headings: Array) -> Signatures:
        """Signatures of landmarks, world frame, given the headings of all key frames in it, shape (k,) [rad]."""
        anchors = self.anchors[landmarks]
        headings_before = np.where(self.key_frames[landmarks] == ACTIVE, self.headings[landmarks], 0.0)
        turns = np.where(anchors == ACTIVE, 0.0, headings[anchors] - headings_before)
        return self.signatures(landmarks).turned(turns)

    def find(self, identities: Indices) -> Indices:
        """Landmark of each identity, -1 where there is none yet."""
        equal = identities[:, None] == self.identities[None, :]
        return np.where(equal.any(axis=1), equal.argmax(axis=1), -1) if len(self) else np.full(len(identities), -1)

    def confirmed(self, least_observations: int) -> NDArray[np.bool_]:
        """Whether each landmark was seen so often, and neither pruned nor merged, shape (n,)."""
        return (self.observations >= least_observations) & (self.key_frames > MERGED)

    def counts(self, least_observations: int) -> LandmarkCounts:
        """Count what became of them, given how often a landmark has to be seen to be confirmed."""
        confirmed = int(self.confirmed(least_observations).sum())
        removed, merged = int((self.key_frames == REMOVED).sum()), int((self.key_frames == MERGED).sum())
        tentative = len(self) - confirmed - removed - merged
        pruned = removed - self._seldom_seen
        return LandmarkCounts(
            len(self), tentative, confirmed, pruned, self._seldom_seen, merged, self._rested, self._woken
        )

    def add(
        self, corners_robot: Corners, chosen: Indices, heading: float, identities: Indices | None = None
    ) -> Indices:
        """Append a landmark for each of the chosen corners, with its identity if it is known; return their indices."""
        first, count = len(self), len(chosen)
        self._sums = np.concatenate([self._sums, _signature(corners_robot, chosen, heading)])
        self.kinds = np.concatenate([self.kinds, corners_robot.kinds[chosen]])
        known = np.full(count, -1) if identities is None else identities
        self.identities = np.concatenate([self.identities, known])
        self.observations = np.concatenate([self.observations, np.ones(count, np.int64)])
        self.misses = np.concatenate([self.misses, np.zeros(count, np.int64)])
        self.overlooked = np.concatenate([self.overlooked, np.zeros(count, np.int64)])
        self.farthest = np.concatenate([self.farthest, _distances(corners_robot, chosen)])
        self.key_frames = np.concatenate([self.key_frames, np.full(count, ACTIVE)])
        self.anchors = np.concatenate([self.anchors, np.full(count, ACTIVE)])
        self.headings = np.concatenate([self.headings, np.full(count, np.nan)])
        self.positions = np.concatenate([self.positions, np.full((count, 2), np.nan)])
        self.covs = np.concatenate([self.covs, np.full((count, 2, 2), np.nan)])
        return np.arange(first, len(self))

    def see(self, landmarks: Indices, corners_robot: Corners, chosen: Indices, heading: float) -> None:
        """Count the chosen corners as observations of these landmarks, each landmark at most once."""
        self._sums[landmarks] += _signature(corners_robot, chosen, heading)
        self.observations[landmarks] += 1
        self.farthest[landmarks] = np.maximum(self.farthest[landmarks], _distances(corners_robot, chosen))

    def anchor(self, landmarks: Indices, key_frame: int, heading: float, positions_robot: Array, covs: Array) -> None:
        """Remember where landmarks are from a key frame of that heading: positions (k, 2), covariances (k, 2, 2)."""
        self.anchors[landmarks] = key_frame
        self.headings[landmarks] = heading
        self.positions[landmarks] = positions_robot
        self.covs[landmarks] = covs

    def deactivate(self, landmarks: Indices) -> None:
        """Make landmarks that have an anchor inactive there."""
        self._rested += len(landmarks)
        self.turn(landmarks, -self.headings[landmarks])
        self.key_frames[landmarks] = self.anchors[landmarks]

    def activate(self, landmarks: Indices, headings: Array) -> None:
        """Make landmarks active again, whose anchors have these headings [rad]."""
        self._woken += len(landmarks)
        self.turn(landmarks, headings)
        self.headings[landmarks] = headings
        self.key_frames[landmarks] = ACTIVE

    def turn(self, landmarks: Indices, angle: Array | float) -> None:
        """Turn the orientations of landmarks counter-clockwise, as their frame is turned [rad]."""
        self._sums[landmarks, 1:] = rotate_each(self._sums[landmarks, 1:], angle)

    def rebase(self, landmarks: Indices, angle: float) -> None:
        """Turn the frame of landmarks in the state [rad]."""
        self.turn(landmarks, angle)
        self.headings[landmarks] += angle

    def miss(
        self,
        landmarks: Indices,
        missed: NDArray[np.bool_],
        overlooked: NDArray[np.bool_],
        least_sighted: float,
    ) -> NDArray[np.bool_]:
        """Count misses and what was overlooked; remove landmarks that are contradicted, and return which, shape (k,).

        These have more misses than observations, or fewer than the share ``least_sighted`` of all that had them in
        sight, one observation taken as granted, as a share of few is uncertain.
        """
        self.misses[landmarks[missed]] += 1
        self.overlooked[landmarks[overlooked]] += 1
        observations = self.observations[landmarks]
        pruned = self.misses[landmarks] > observations
        sighted = observations + 1
        seldom = ~pruned & (sighted < least_sighted * (sighted + self.overlooked[landmarks]))
        self._seldom_seen += int(seldom.sum())
        self.key_frames[landmarks[pruned | seldom]] = REMOVED
        return pruned | seldom

    def merge(self, kept: int, other: int) -> None:
        """Merge two landmarks: ``kept`` takes the counts of ``other``, and its anchor if that is newer."""
        self._sums[kept] += self._sums[other]
        self.observations[kept] += self.observations[other]
        self.misses[kept] += self.misses[other]
        self.overlooked[kept] += self.overlooked[other]
        self.farthest[kept] = max(self.farthest[kept], self.farthest[other])
        if self.anchors[other] > self.anchors[kept]:
            for column in (self.anchors, self.headings, self.positions, self.covs):
                column[kept] = column[other]
        self.key_frames[other] = MERGED


def _distances(corners_robot: Corners, chosen: Indices) -> Array:
    return np.hypot(*corners_robot.positions[chosen].T)


def _signature(corners_robot: Corners, chosen: Indices, heading: float) -> Array:
    directions = corners_robot.orientations[chosen] + heading
    return np.stack([corners_robot.opening_angles[chosen], np.cos(directions), np.sin(directions)], axis=-1)
