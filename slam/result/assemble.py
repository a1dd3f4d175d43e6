"""The result of a run, assembled from its records, its key frames and the solution of its graph."""

from collections.abc import Sequence

import numpy as np

from features.se2 import transform
from slam.config import SlamConfig
from slam.graph.values import GraphEstimate
from slam.key_frame import KeyFrame
from slam.map.landmark_map import LandmarkMap
from slam.result.records import Records
from slam.result.result import SlamResult
from slam.result.run_metrics import RunMetrics


def assemble_result(
    records: Records,
    key_frames: Sequence[KeyFrame],
    estimate: GraphEstimate,
    landmarks: LandmarkMap,
    metrics: RunMetrics,
    config: SlamConfig,
) -> SlamResult:
    """Apply the corrections of the key frames to all records, and place what the key frames saw in the world."""
    scans = np.array([key_frame.scan for key_frame in key_frames])
    placed = list(zip(estimate.poses_world_robot, key_frames, strict=True))
    return SlamResult(
        trajectory=records.corrected(scans, estimate.poses_world_robot),
        trajectory_online=records.online(),
        trajectory_odometry=records.odometry(),
        wheel_odometry=records.wheels(),
        landmarks=landmarks,
        walls=np.concatenate([transform(pose, key_frame.walls_robot) for pose, key_frame in placed]),
        points=np.concatenate([transform(pose, key_frame.points_robot) for pose, key_frame in placed]),
        metrics=metrics,
        config=config,
    )
