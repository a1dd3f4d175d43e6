"""The result of processing one frame."""

from dataclasses import dataclass

from features.feature import Features
from features.se2 import Array, Pose
from slam.filter.association import Association


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What one frame did.

    Parameters
    ----------
    stamp : of the pose [s]: that of the frame, or the middle of the sweep where the beams of its scan have times.
    pose_world_robot : pose of the filter after the frame, shape (3,).
    features : lines and corners of its scan, sensor frame; None for a frame without scan.
    association : what became of the corners; None where the robot had not moved enough to use them.
    cov : covariance of that pose, shape (3, 3), where the filter was updated; else None.
    before : steps of all earlier frames where this frame ended the measurement of the sensor's noise, with which they
        were processed anew; empty otherwise.
    """

    stamp: float
    pose_world_robot: Pose
    features: Features | None = None
    association: Association | None = None
    cov: Array | None = None
    before: "tuple[Step, ...]" = ()
