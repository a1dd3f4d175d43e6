"""Random corners and how they are seen, for the tests of constellations and of the index of places."""

import math

import numpy as np

from features.feature import Corners
from features.se2 import transform, wrap_angle
from features.signature import Kind, Signatures
from slam.loop.constellation import Constellation

SIGMA_POSITION, SIGMA_ANGLE = 0.05, math.radians(3.0)
"""Errors of a corner that is the mean of several sightings [m, rad]."""


def scattered(rng, count, size=14.0, apart=1.2) -> Constellation:
    """Corners anywhere in a square, no two nearer than ``apart``, none like another."""
    positions = np.empty((0, 2))
    while len(positions) < count:
        at = rng.uniform(-size / 2.0, size / 2.0, 2)
        if len(positions) == 0 or np.hypot(*(positions - at).T).min() > apart:
            positions = np.concatenate([positions, at[None]])
    orientations = rng.uniform(-math.pi, math.pi, count)
    opening_angles = rng.choice(np.radians([60.0, 90.0, 120.0]), count)
    kinds = np.where(rng.random(count) < 0.5, Kind.CONVEX, Kind.CONCAVE)
    return Constellation(positions, Signatures(kinds, opening_angles, orientations))


def seen_again(corners: Constellation, pose_there_here, rng, kept=None) -> Constellation:
    """Some of the corners, of a frame there, as they are seen in a frame here, in another order and with errors."""
    kept = rng.permutation(len(corners)) if kept is None else kept
    back = rng.normal(0.0, SIGMA_POSITION, (len(kept), 2)) + corners.positions[kept] - pose_there_here[:2]
    c, s = math.cos(pose_there_here[2]), math.sin(pose_there_here[2])
    turns = rng.normal(0.0, SIGMA_ANGLE, (2, len(kept)))
    signatures = corners.signatures[kept]
    return Constellation(
        back @ np.array([[c, -s], [s, c]]),
        Signatures(
            signatures.kinds,
            signatures.opening_angles + turns[1],
            wrap_angle(signatures.orientations - pose_there_here[2] + turns[0]),
        ),
    )


def mirrored(corners: Constellation) -> Constellation:
    """The same corners in a looking-glass."""
    signatures = corners.signatures
    return Constellation(
        corners.positions * np.array([1.0, -1.0]),
        Signatures(signatures.kinds, signatures.opening_angles, -signatures.orientations),
    )


def as_corners(constellation: Constellation, pose) -> Corners:
    """Corners of a constellation as a pose in its frame sees them, robot frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return Corners.of(
        (constellation.positions - pose[:2]) @ np.array([[c, -s], [s, c]]),
        np.tile(1e-4 * np.eye(2), (len(constellation), 1, 1)),
        constellation.signatures.turned(-pose[2]),
    )


def world_of(constellation: Constellation, pose) -> Constellation:
    """A constellation moved by a pose."""
    return Constellation(transform(pose, constellation.positions), constellation.signatures.turned(pose[2]))
