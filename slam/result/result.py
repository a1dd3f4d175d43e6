"""Everything that a run yields: trajectories, the landmark map, the walls as seen and the figures of the run."""

from dataclasses import dataclass

from features.se2 import Array
from slam.config import SlamConfig
from slam.map.landmark_map import LandmarkMap
from slam.result.run_metrics import RunMetrics
from slam.result.trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class SlamResult:
    """Everything that a run knows at its end, world frame.

    Parameters
    ----------
    trajectory : final pose of every record.
    trajectory_online : pose of the filter at each scan, as it was known at the time.
    trajectory_odometry : pose of every record by odometry alone, as configured, without landmarks.
    wheel_odometry : odometry pose of every record from the log.
    landmarks : the map.
    walls : lines seen from the key frames, ends, shape (n, 2, 2) [m].
    points : scan points of the key frames, shape (m, 2) [m].
    metrics : figures of the run.
    config : what the run was configured with.
    """

    trajectory: Trajectory
    trajectory_online: Trajectory
    trajectory_odometry: Trajectory
    wheel_odometry: Trajectory
    landmarks: LandmarkMap
    walls: Array
    points: Array
    metrics: RunMetrics
    config: SlamConfig
