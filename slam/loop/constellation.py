"""Constellations of corners: the corners of a passage, and how one constellation lies on another."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, Pose, transform, wrap_angle
from slam.evaluation.metrics import align

SAME_DISTANCE = 0.3
"""Corners of one passage that are nearer than this, of one kind and signature, are one [m]."""

SAME_ANGLE = math.radians(25.0)
"""How far orientations and opening angles of one corner may differ [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Constellation:
    """Corners of a passage, each once, in one frame.

    Parameters
    ----------
    positions : shape (n, 2) [m].
    orientations : directions of the bisectors, shape (n,) [rad].
    opening_angles : shape (n,) [rad].
    convex : shape (n,).
    """

    positions: Array
    orientations: Array
    opening_angles: Array
    convex: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.positions)


def gather(poses: Sequence[Pose], corners: Sequence[Corners]) -> Constellation:
    """Put corners that were seen from several poses together.

    Parameters
    ----------
    poses : of the robot, in the frame of the constellation.
    corners : seen from each pose, robot frame.
    """
    positions = np.concatenate([transform(pose, each.positions) for pose, each in zip(poses, corners, strict=True)])
    orientations = np.concatenate([pose[2] + each.orientations for pose, each in zip(poses, corners, strict=True)])
    seen = Constellation(
        positions,
        wrap_angle(orientations),
        np.concatenate([each.opening_angles for each in corners]),
        np.concatenate([each.convex for each in corners]),
    )
    return _merged(seen)


def _merged(seen: Constellation) -> Constellation:
    """Mean of the sightings of each corner, in the order of the first ones."""
    alike = _alike(seen, seen, SAME_DISTANCE, SAME_ANGLE)
    left = np.ones(len(seen), np.bool_)
    firsts, positions, orientations, openings = [], [], [], []
    for first in range(len(seen)):
        if not left[first]:
            continue
        same = alike[first] & left
        left &= ~same
        firsts.append(first)
        positions.append(seen.positions[same].mean(axis=0))
        turns = wrap_angle(seen.orientations[same] - seen.orientations[first])
        orientations.append(wrap_angle(float(seen.orientations[first] + turns.mean())))
        openings.append(seen.opening_angles[same].mean())
    return Constellation(
        np.array(positions).reshape(-1, 2), np.array(orientations), np.array(openings), seen.convex[firsts]
    )


def _alike(one: Constellation, other: Constellation, distance: float, angle: float) -> NDArray[np.bool_]:
    """Which corners of one may be which of the other, given in the same frame, shape (n, m)."""
    apart = one.positions[:, None] - other.positions
    return (
        (np.hypot(apart[..., 0], apart[..., 1]) <= distance)
        & (np.abs(wrap_angle(one.orientations[:, None] - other.orientations)) <= angle)
        & (np.abs(one.opening_angles[:, None] - other.opening_angles) <= angle)
        & (one.convex[:, None] == other.convex)
    )


def lay(here: Constellation, there: Constellation, pose_there_here: Pose, distance: float) -> tuple[Pose, int]:
    """Lay a constellation on another and move it to where corners that lie on one another fit best (eq. M53).

    Parameters
    ----------
    here, there : the constellations.
    pose_there_here : where it is laid at first, shape (3,).
    distance : how far apart two sightings of a corner may lie [m].

    Returns
    -------
    Where it then lies, shape (3,), and the number of corners that lie on one another, each counted once on either side.
    """
    count = 0
    for _ in range(2):
        pairs = _pairs(_moved(here, pose_there_here), there, distance)
        if len(pairs) < max(count, 2):
            break
        count = len(pairs)
        pose_there_here = align(there.positions[pairs[:, 1]], here.positions[pairs[:, 0]])
    return pose_there_here, count


def _moved(constellation: Constellation, pose: Pose) -> Constellation:
    return Constellation(
        transform(pose, constellation.positions),
        constellation.orientations + pose[2],
        constellation.opening_angles,
        constellation.convex,
    )


def _pairs(one: Constellation, other: Constellation, distance: float) -> NDArray[np.int64]:
    """Corners of one and of the other that are mutually nearest among those alike, shape (k, 2)."""
    apart = np.where(
        _alike(one, other, distance, SAME_ANGLE),
        np.linalg.norm(one.positions[:, None] - other.positions, axis=2),
        np.inf,
    )
    nearest = apart.argmin(axis=1)
    mutual = (apart.argmin(axis=0)[nearest] == np.arange(len(one))) & np.isfinite(apart.min(axis=1))
    return np.column_stack([np.flatnonzero(mutual), nearest[mutual]])
