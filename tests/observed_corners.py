"""Corners as a scan would show them, for the tests of association and of the front end."""

import math

import numpy as np

from features.feature import Corners
from features.signature import Kind, Signatures

SIGMA = 0.05
"""Standard deviation of a coordinate [m]."""


def corners(positions, openings=math.pi / 2, orientations=0.3, convex=False, sigma=SIGMA):
    positions = np.array(positions, dtype=np.float64).reshape(-1, 2)
    k = len(positions)
    return Corners.of(
        positions,
        np.repeat(np.diag(np.broadcast_to(sigma, 2) ** 2)[None], k, axis=0),
        Signatures(
            np.where(np.full(k, convex), Kind.CONVEX, Kind.CONCAVE),
            np.full(k, openings, dtype=np.float64),
            np.full(k, orientations, dtype=np.float64),
        ),
    )


def points(positions, sigma=SIGMA):
    """Points that are no corners, such as barcodes."""
    seen = corners(positions, sigma=sigma)
    return Corners.of(seen.positions, seen.covs, Signatures.of_points(len(seen)))
