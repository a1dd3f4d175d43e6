"""Random trajectories for tests."""

import numpy as np

from features.se2 import compose, pose
from slam.result.trajectory import Trajectory


def random_pair(seed, count=200):
    """A walk and a disturbed copy of it with other stamps, of which some are missing."""
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.uniform(0.05, 0.3, count))
    steps = np.column_stack([rng.uniform(0.0, 0.5, (count, 1)), rng.normal(0.0, [0.02, 0.3], (count, 2))])
    walk = [pose(3.0, -2.0, 1.0)]
    for step in steps[1:]:
        walk.append(compose(walk[-1], step))
    poses = np.array(walk)
    disturbed = moved(poses + rng.normal(0.0, [0.3, 0.3, 0.2], poses.shape), pose(5.0, 7.0, -2.0))
    kept = np.sort(rng.choice(count, count - 30, replace=False))
    estimate_stamps = np.sort(stamps + rng.uniform(-0.024, 0.024, count))
    return Trajectory(stamps, poses), Trajectory(estimate_stamps[kept], disturbed[kept])


def moved(poses, pose_a_b):
    return np.array([compose(pose_a_b, pose_b) for pose_b in poses])
