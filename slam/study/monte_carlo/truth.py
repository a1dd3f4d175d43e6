"""What a run decided, held against the truth of the simulator: associations, closures, landmarks."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from features.feature import Features
from features.fitting.corner import intersect
from features.se2 import Array, between, wrap_angle
from sim import Measurement, World, label_corners
from slam.evaluation.evaluate import CORNER_DISTANCE
from slam.evaluation.metrics import nees
from slam.filter.association import Association
from slam.graph.values import Closure

Labels = NDArray[np.int64]

FALSE_POSITION, FALSE_HEADING = 0.5, np.radians(5.0)
"""A closure that errs by more is of another place [m, rad]."""


@dataclass(slots=True)
class AssociationScore:
    """Counts associations against the true corner of each observation.

    A landmark is the corner that most of its observations are of, of equals the first one. That of its birth alone
    would not do: beams that pass an edge feign a corner beside it, of no label, and what is seen there later is the
    edge.
    A match is right if its observation is of the corner that the landmark is; an observation is known if some landmark
    of before was its corner.

    Parameters
    ----------
    matches : landmark and true corner, -1 for none, of the observations that were associated, of each scan.
    births : true corner of the observations that new landmarks were born of, of each scan.
    seen : true corners of all observations of each scan.
    """

    matches: list[tuple[Labels, Labels]] = field(default_factory=list[tuple[Labels, Labels]])
    births: list[Labels] = field(default_factory=list[Labels])
    seen: list[Labels] = field(default_factory=list[Labels])

    def count(self, association: Association, labels: Labels) -> None:
        """Count what became of the observations of one scan.

        Parameters
        ----------
        association : of the observed corners.
        labels : true corner of each observed one, -1 for none, shape (k,).
        """
        self.matches.append((association.landmarks, labels[association.corners]))
        self.births.append(labels[association.new])
        self.seen.append(labels)

    def corners(self) -> Labels:
        """Return the true corner of each landmark, -1 for none."""
        births = np.concatenate([np.empty(0, np.int64), *self.births])
        seen: list[list[int]] = [[corner] if corner >= 0 else [] for corner in births.tolist()]
        for landmarks, labels in self.matches:
            slots: list[int] = landmarks.tolist()
            for landmark, corner in zip(slots, labels.tolist(), strict=True):
                if corner >= 0:
                    seen[landmark].append(corner)
        return np.array([max(each, key=each.count, default=-1) for each in seen], np.int64)

    def precision(self) -> float | None:
        """Share of the matches that are right; None where there are none."""
        corners = self.corners()
        right = [(corners[landmarks] == labels) & (labels >= 0) for landmarks, labels in self.matches]
        return _share(right)

    def recall(self) -> float | None:
        """Right matches per observation of a known corner; None where there are none."""
        corners = self.corners()
        born, right, known = 0, 0, 0
        for (landmarks, matched), births, labels in zip(self.matches, self.births, self.seen, strict=True):
            right += int(((corners[landmarks] == matched) & (matched >= 0)).sum())
            known += int((np.isin(labels, corners[:born]) & (labels >= 0)).sum())
            born += len(births)
        return right / known if known else None


def _share(parts: Sequence[NDArray[np.bool_]]) -> float | None:
    whole = np.concatenate([np.empty(0, np.bool_), *parts])
    return float(whole.mean()) if len(whole) else None


def true_corners(world: World, measurement: Measurement, features: Features, positions_world: Array) -> Labels:
    """Find the true corner of each extracted one: the nearest at which two walls meet that its two lines hit.

    Where there is none, as a line of few points may blend two walls, the nearest of those whose two walls the scan hit.

    Parameters
    ----------
    world : the walls and their corners.
    measurement : the scan and what each beam of it met.
    features : lines and corners of the scan, sensor frame.
    positions_world : the corners as seen from the true pose, shape (k, 2) [m].

    Returns
    -------
    Indices into ``world.corners``, -1 for none within :data:`slam.evaluation.evaluate.CORNER_DISTANCE`, shape (k,).
    """
    labels = label_corners(world, measurement.wall_ids, positions_world, CORNER_DISTANCE)
    walls = world.corner_walls
    for corner, (a, b) in enumerate(_lines_of_corners(features)):
        by_a, by_b = (np.isin(walls, _walls_hit(measurement.wall_ids, features.lines.beams[line])) for line in (a, b))
        possible = (by_a & by_b[:, ::-1]).any(axis=1)
        apart = np.where(possible, np.hypot(*(world.corners - positions_world[corner]).T), np.inf)
        if apart.min(initial=np.inf) <= CORNER_DISTANCE:
            labels[corner] = apart.argmin()
    return labels


def _lines_of_corners(features: Features) -> list[tuple[int, int]]:
    """Return the two lines whose intersection each corner is: neighbours, in the order of the corners."""
    lines, found = list(features.lines), list[tuple[int, int]]()
    for a, line in enumerate(lines):
        b = (a + 1) % len(lines)
        if len(found) == len(features.corners):
            break
        try:
            position, _ = intersect(line, lines[b])
        except ValueError:
            continue
        if (position == features.corners.positions[len(found)]).all():
            found.append((a, b))
    return found


def _walls_hit(wall_ids: NDArray[np.int64], beams: NDArray[np.int64]) -> NDArray[np.int64]:
    """Walls that the beams from the first to the last of a line hit, counted on over the end of the scan."""
    first, last = beams.tolist()
    walls = wall_ids[np.arange(first, first + (last - first) % len(wall_ids) + 1) % len(wall_ids)]
    return walls[walls >= 0]


@dataclass(frozen=True, slots=True, eq=False)
class ClosureScore:
    """Closures that a run accepted, against the truth.

    Parameters
    ----------
    accepted, revoked : how many entered the graph, and how many of these it left out at the end.
    false : how many of those that stayed are of another place.
    nees : of those that stayed and are right, with their covariance, shape (k,).
    """

    accepted: int
    revoked: int
    false: int
    nees: Array

    @classmethod
    def of(cls, closures: Sequence[Closure], revoked: Sequence[Closure], poses_world_robot: Array) -> "ClosureScore":
        """Compare closures with the true poses of the key frames, shape (n, 3)."""
        kept = [closure for closure in closures if closure not in revoked]
        motions = [between(poses_world_robot[closure.older], poses_world_robot[closure.newer]) for closure in kept]
        errors = np.array([closure.motion - motion for closure, motion in zip(kept, motions, strict=True)]).reshape(
            -1, 3
        )
        errors[:, 2] = wrap_angle(errors[:, 2])
        wrong = (np.hypot(errors[:, 0], errors[:, 1]) > FALSE_POSITION) | (np.abs(errors[:, 2]) > FALSE_HEADING)
        covs = np.array([closure.cov for closure in kept]).reshape(-1, 3, 3)
        return cls(len(closures), len(revoked), int(wrong.sum()), nees(errors[~wrong], covs[~wrong]))
