"""What a run decided, held against the truth of the simulator: associations, closures, landmarks."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from features.corner import intersect
from features.feature import Features
from features.se2 import Array, between, wrap_angle
from sim import Measurement, World, label_corners
from slam.association import Association
from slam.evaluate import CORNER_DISTANCE
from slam.graph import Closure
from slam.metrics import nees

Labels = NDArray[np.int64]

FALSE_POSITION, FALSE_HEADING = 0.5, np.radians(5.0)
"""A closure that errs by more is of another place [m, rad]."""


@dataclass(slots=True)
class AssociationScore:
    """Counts associations against the true corner of each observation.

    A landmark is the corner whose observation it was born of. A match is right if its observation is of that corner; an
    observation is known if some landmark was its corner already.

    Parameters
    ----------
    matches, right : observations that were associated, and those of them that belong to their landmark.
    known : observations of corners that were on the map.
    corners : true corner of each landmark, -1 for none.
    """

    matches: int = 0
    right: int = 0
    known: int = 0
    corners: list[int] = field(default_factory=list)

    def count(self, association: Association, labels: Labels) -> None:
        """Count what became of the observations of one scan.

        Parameters
        ----------
        association : of the observed corners.
        labels : true corner of each observed one, -1 for none, shape (k,).
        """
        known = np.isin(labels, self.corners) & (labels >= 0)
        of_landmarks = np.array(self.corners, dtype=np.int64)[association.landmarks]
        matched = labels[association.corners]
        self.matches += len(matched)
        self.right += int(((matched == of_landmarks) & (matched >= 0)).sum())
        self.known += int(known.sum())
        self.corners += labels[association.new].tolist()


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
    Indices into ``world.corners``, -1 for none within :data:`slam.evaluate.CORNER_DISTANCE`, shape (k,).
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
