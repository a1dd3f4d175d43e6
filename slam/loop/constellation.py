"""Constellations of corners: the corners of a submap, and how one constellation lies on another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, Pose, align, transform, wrap_angle
from features.signature import Signatures, alike
from slam.loop.rules import PlaceRules


@dataclass(frozen=True, slots=True, eq=False)
class Constellation:
    """Corners of a submap, each once, in one frame.

    Parameters
    ----------
    positions : shape (n, 2) [m].
    signatures : in that frame, shape (n,).
    """

    positions: Array
    signatures: Signatures

    def __len__(self) -> int:
        return len(self.positions)


def collect_constellation(
    poses: Sequence[Pose],
    corners: Sequence[Corners],
    rules: PlaceRules = PlaceRules(),  # noqa: B008, frozen
) -> Constellation:
    """Put corners that were seen from several poses together.

    Parameters
    ----------
    poses : of the robot, in the frame of the constellation.
    corners : seen from each pose, robot frame.
    rules : which corners are one.
    """
    placed = list(zip(poses, corners, strict=True))
    positions = np.concatenate([transform(pose, each.positions) for pose, each in placed])
    signatures = Signatures.concatenate([each.signatures.turned(pose[2]) for pose, each in placed])
    signatures = replace(signatures, orientations=wrap_angle(signatures.orientations))
    return _merged(Constellation(positions, signatures), rules)


def _merged(seen: Constellation, rules: PlaceRules) -> Constellation:
    """Mean of the sightings of each corner, in the order of the first ones."""
    same_corner = _same(seen, seen, rules.same_distance, rules.same_angle)
    openings, orientations = seen.signatures.opening_angles, seen.signatures.orientations
    left = np.ones(len(seen), np.bool_)
    firsts: list[int] = []
    positions: list[Array] = []
    mean_openings: list[float] = []
    mean_orientations: list[float] = []
    for first in range(len(seen)):
        if not left[first]:
            continue
        same = same_corner[first] & left
        left &= ~same
        firsts.append(first)
        positions.append(seen.positions[same].mean(axis=0))
        mean_openings.append(openings[same].mean())
        turns = wrap_angle(orientations[same] - float(orientations[first]))
        mean_orientations.append(wrap_angle(float(orientations[first] + turns.mean())))
    signatures = Signatures(seen.signatures.kinds[firsts], np.array(mean_openings), np.array(mean_orientations))
    return Constellation(np.array(positions).reshape(-1, 2), signatures)


def _same(one: Constellation, other: Constellation, distance: float, angle: float) -> NDArray[np.bool_]:
    """Which corners of one may be which of the other, given in the same frame, shape (n, m)."""
    apart = one.positions[:, None] - other.positions
    near = np.hypot(apart[..., 0], apart[..., 1]) <= distance
    return near & alike(one.signatures[:, None], other.signatures, angle, angle)


def fit_constellation(
    here: Constellation,
    there: Constellation,
    pose_there_here: Pose,
    rules: PlaceRules = PlaceRules(),  # noqa: B008, frozen
) -> tuple[Pose, int]:
    """Register a constellation to another by the corners that coincide (eq. M53).

    Parameters
    ----------
    here, there : the constellations.
    pose_there_here : initial guess, shape (3,).
    rules : how far two sightings of a corner may differ, and how often the fit is made.

    Returns
    -------
    Pose of the frame here in the frame there, shape (3,), and the number of corners that coincide.
    """
    count = 0
    for _ in range(rules.fits):
        moved = Constellation(transform(pose_there_here, here.positions), here.signatures.turned(pose_there_here[2]))
        pairs = _pairs(moved, there, rules.corner_tolerance, rules.same_angle)
        if len(pairs) < max(count, 2):
            break
        count = len(pairs)
        pose_there_here = align(there.positions[pairs[:, 1]], here.positions[pairs[:, 0]])
    return pose_there_here, count


def _pairs(one: Constellation, other: Constellation, distance: float, angle: float) -> NDArray[np.int64]:
    """Corners of one and of the other that are mutually nearest among those alike, shape (k, 2)."""
    apart = np.where(
        _same(one, other, distance, angle),
        np.linalg.norm(one.positions[:, None] - other.positions, axis=2),
        np.inf,
    )
    nearest = apart.argmin(axis=1)
    mutual = (apart.argmin(axis=0)[nearest] == np.arange(len(one))) & np.isfinite(apart.min(axis=1))
    return np.column_stack([np.flatnonzero(mutual), nearest[mutual]])
