"""An association of your own: the nearest landmark within half a metre, whatever the covariances say.

It fulfils :class:`slam.filter.association.Associator` and nothing else of the project changes.
"""

import numpy as np
from scipy.optimize import linear_sum_assignment

from features import Corners
from sim import room_run
from slam import Slam, SlamConfig, Trajectory, ate
from slam.filter.association import Association, Gates, Signatures
from slam.filter.ekf import LandmarkEkf

NEAR = 0.5
"""A corner farther than this from all landmarks is a new one [m]."""


class NearestInMetres:
    """Pairs corners and landmarks with the least sum of distances, each at most once."""

    def __call__(self, corners_robot: Corners, ekf: LandmarkEkf, signatures: Signatures, gates: Gates) -> Association:
        """Match corners, robot frame, to the landmarks of the filter."""
        apart = corners_robot.positions[:, None] - ekf.positions_robot()
        distances = np.hypot(apart[..., 0], apart[..., 1])
        corners, landmarks = linear_sum_assignment(np.minimum(distances, NEAR))
        near = distances[corners, landmarks] < NEAR
        new = np.flatnonzero((distances >= NEAR).all(axis=1))
        return Association(corners[near], landmarks[near], new)


if __name__ == "__main__":
    run = room_run(1)
    slam = Slam(SlamConfig.of_preset(run.sensor, run.mounting), associator=NearestInMetres())
    for frame in run:
        slam.process(frame)
    result = slam.finish()
    error = ate(Trajectory(run.stamps, run.poses_world_robot), result.trajectory)
    print(f"ATE {1e3 * error.rmse_m:.1f} mm, {len(result.landmarks)} landmarks")
