"""True motions between stamps, and how far a trajectory is from them."""

import os
from dataclasses import dataclass

import numpy as np

from features.errors import CwlfError
from features.se2 import Array
from slam.evaluation.metrics import UnmatchedError, magnitudes, motions_between, pose_differences, span
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import read_rows

RELATION_TOLERANCE = 0.05
"""A pose belongs to the stamp of a relation if it differs by no more than this [s]."""


class RelationsFormatError(CwlfError):
    """A relations file that cannot be read; the message names the file, the line and what was expected."""


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """True motions between stamps.

    Parameters
    ----------
    stamps_from, stamps_to : shape (n,) [s].
    poses_from_to : pose at the second stamp in the robot frame at the first, shape (n, 3) [m, m, rad].

    Raises
    ------
    ValueError
        Shapes do not fit or a value is not finite.
    """

    stamps_from: Array
    stamps_to: Array
    poses_from_to: Array

    def __post_init__(self) -> None:
        shapes = [array.shape for array in (self.stamps_from, self.stamps_to, self.poses_from_to)]
        n = len(self.stamps_from)
        if shapes != [(n,), (n,), (n, 3)]:
            raise ValueError(f"relations of shapes {shapes}: expected (n,), (n,) and (n, 3)")
        if not all(np.isfinite(array).all() for array in (self.stamps_from, self.stamps_to, self.poses_from_to)):
            raise ValueError("a stamp or pose is not finite: expected seconds, metres and radians")

    def __len__(self) -> int:
        return len(self.stamps_from)


@dataclass(frozen=True, slots=True)
class RelationError:
    """Error over relations, as in the Freiburg SLAM benchmark.

    Parameters
    ----------
    translation_mean_m, translation_std_m : mean and population standard deviation of the distances [m].
    rotation_mean_deg, rotation_std_deg : the same of the absolute angles [deg].
    count : number of relations that went in.
    uncounted : number of relations left out because no pose was near enough in time.
    """

    translation_mean_m: float
    translation_std_m: float
    rotation_mean_deg: float
    rotation_std_deg: float
    count: int
    uncounted: int


def read_relations(path: str | os.PathLike[str]) -> Relations:
    """Read relations of lines `t1 t2 x y z roll pitch yaw` [s, m, rad]; x, y and yaw are kept.

    Parameters
    ----------
    path : file to read; blank lines and those that begin with `#` are skipped.

    Raises
    ------
    RelationsFormatError
        The file cannot be read or has no relation, or a line has not eight finite numbers.
    """
    rows = [values for _, values in read_rows(path, ("t1 t2 x y z roll pitch yaw",), RelationsFormatError)]
    if not rows:
        raise RelationsFormatError(f"{path} has no relation: expected lines of `t1 t2 x y z roll pitch yaw`")
    table = np.array(rows)
    return Relations(table[:, 0], table[:, 1], table[:, [2, 3, 7]])


def relations(truth: Relations, estimate: Trajectory, tolerance: float = RELATION_TOLERANCE) -> RelationError:
    """Error of the estimated motion over each relation; it does not depend on the frame of the estimate.

    Source: Kuemmerle et al., On measuring the accuracy of SLAM algorithms, Autonomous Robots 27 (2009).

    Parameters
    ----------
    truth : true motions.
    estimate : trajectory; for a stamp, its pose nearest in time is taken.
    tolerance : a relation with an end that is further than this from all poses is not counted [s].

    Raises
    ------
    UnmatchedError
        No relation can be counted.
    """
    starts = estimate.nearest(truth.stamps_from, tolerance)
    ends = estimate.nearest(truth.stamps_to, tolerance)
    counted = (starts >= 0) & (ends >= 0)
    count = int(counted.sum())
    if count == 0:
        raise UnmatchedError(
            f"none of {len(truth)} relations has both its stamps within {tolerance:g} s of poses of the estimate "
            f"({span(estimate)})"
        )
    motions = motions_between(estimate.poses, starts[counted], ends[counted])
    translations, rotations = magnitudes(pose_differences(truth.poses_from_to[counted], motions))
    return RelationError(
        translation_mean_m=float(translations.mean()),
        translation_std_m=float(translations.std()),
        rotation_mean_deg=float(rotations.mean()),
        rotation_std_deg=float(rotations.std()),
        count=count,
        uncounted=len(truth) - count,
    )
