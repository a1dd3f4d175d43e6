"""The exchange between filter and graph: merged landmarks, loop closures, and the pose of the robot after them."""

import numpy as np

from features.se2 import rotation
from slam.filter.front_end import FrontEnd
from slam.graph.back_end import BackEnd
from slam.loop.closer import LoopCloser


def merge(front: FrontEnd, graph: BackEnd) -> None:
    """Merge the landmarks that the filter finds to be one, in filter and graph."""
    for kept, other in front.merge():
        graph.merge(kept, other)


def rebase(front: FrontEnd, graph: BackEnd) -> bool:
    """Move the filter to the pose of the newest key frame in the graph; False where its covariance is unknown."""
    cov = graph.newest_cov()
    if cov is None:
        return False
    front.rebase(graph.poses_world_robot[-1], cov)
    return True


def close_loop(closer: LoopCloser, front: FrontEnd, graph: BackEnd) -> None:
    """Search for a place seen before; where one is found, correct the graph and then the filter."""
    closures = closer.find(graph.poses_world_robot)
    if not closures:
        return
    for closure in closures:
        graph.add_closure(closure)
    graph.update()
    if not rebase(front, graph):
        return
    poses = graph.poses_world_robot
    for closure in closures:
        # Where an earlier key frame closes the loop, the next search near by closes it at the newest one too.
        if closure.newer == len(graph) - 1:
            turn = np.eye(3)
            turn[:2, :2] = rotation(poses[closure.older, 2])
            front.reactivate(poses, closer.submap(closure.older), turn @ closure.cov @ turn.T)
    merge(front, graph)
