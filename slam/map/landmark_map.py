"""The landmark map, taken from the solution of a graph and written as a table."""

import csv
import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from features.signature import Kind, Signatures
from slam.graph.solution import Solution


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMap:
    """Corners of the building, or other points, world frame.

    Parameters
    ----------
    ids : shape (n,).
    positions : shape (n, 2) [m].
    covs : shape (n, 2, 2) [m^2].
    observations : times each was observed, shape (n,).
    signatures : of the corners or points, world frame, shape (n,).
    identities : by which the source knows each, -1 for none, shape (n,).
    """

    ids: NDArray[np.int64]
    positions: Array
    covs: Array
    observations: NDArray[np.int64]
    signatures: Signatures
    identities: NDArray[np.int64]

    @property
    def points(self) -> NDArray[np.bool_]:
        """Whether each is a point that is no corner, shape (n,)."""
        return self.signatures.kinds == Kind.POINT

    @property
    def convex(self) -> NDArray[np.bool_]:
        """Whether each is a convex corner, shape (n,)."""
        return self.signatures.kinds == Kind.CONVEX

    @property
    def opening_angles(self) -> Array:
        """Angles between the two walls, shape (n,); NaN for a point that is no corner [rad]."""
        return self.signatures.opening_angles

    def __len__(self) -> int:
        return self.ids.size

    def to_csv(self) -> str:
        """Table with one landmark a line, metres and degrees."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(
            ["id", "x", "y", "cov_xx", "cov_xy", "cov_yy", "observations", "kind", "opening_angle_deg", "identity"],
        )
        for k in range(len(self)):
            x, y = self.positions[k]
            cov = self.covs[k]
            table.writerow(
                [
                    self.ids[k],
                    f"{x:.6f}",
                    f"{y:.6f}",
                    f"{cov[0, 0]:.6e}",
                    f"{cov[0, 1]:.6e}",
                    f"{cov[1, 1]:.6e}",
                    self.observations[k],
                    Kind(self.signatures.kinds[k]).name.lower(),
                    "" if self.points[k] else f"{np.degrees(self.opening_angles[k]):.2f}",
                    "" if self.identities[k] < 0 else self.identities[k],
                ]
            )
        return text.getvalue()


def landmark_map(solution: Solution, least_observations: int) -> LandmarkMap:
    """Landmarks of the solution that are confirmed."""
    estimate, table = solution.estimate, solution.table
    kept = table.confirmed(least_observations)[estimate.landmarks]
    ids = estimate.landmarks[kept]
    return LandmarkMap(
        ids=ids,
        positions=estimate.positions_world[kept],
        covs=estimate.covs[kept],
        observations=table.observations[ids],
        signatures=table.signatures_world(ids, estimate.poses_world_robot[:, 2]),
        identities=table.identities[ids],
    )
