"""Corrections of a few poses, interpolated to every odometry record between them."""

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, compose_each, wrap_angle


def carry_corrections(poses_odom: Array, nodes: NDArray[np.int64], poses_node: Array, stamps: Array) -> Array:
    """Poses of all records, given the corrected poses of some.

    Between two nodes a record is carried forward from the earlier and backward from the later one by odometry, and
    the two are blended by the share of the motion between the nodes that lies behind it. Outside the nodes the
    nearest one carries alone (eq. M20).

    Parameters
    ----------
    poses_odom : odometry of every record, shape (n, 3).
    nodes : record indices of the corrected poses, rising, shape (a,), a >= 1.
    poses_node : corrected poses, world frame, shape (a, 3).
    stamps : of the records, never decreasing, shape (n,) [s].

    Returns
    -------
    shape (n, 3), world frame.
    """
    steps = np.diff(poses_odom, axis=0)
    # A radian of turn weighs as much as a metre; standing still the correction moves on with the time.
    motion = np.hypot(steps[:, 0], steps[:, 1]) + np.abs(wrap_angle(steps[:, 2])) + 1e-9 * np.diff(stamps)
    behind = np.concatenate([[0.0], np.cumsum(motion)])
    records = np.arange(len(poses_odom))
    earlier = np.clip(np.searchsorted(nodes, records, side="right") - 1, 0, len(nodes) - 1)
    later = np.minimum(earlier + 1, len(nodes) - 1)
    later[records < nodes[0]] = 0

    forward = _carry(poses_odom, nodes[earlier], poses_node[earlier])
    backward = _carry(poses_odom, nodes[later], poses_node[later])
    start, end = behind[nodes[earlier]], behind[nodes[later]]
    share = np.divide(behind - start, end - start, out=np.zeros(len(records)), where=end > start)
    difference = backward - forward
    difference[:, 2] = wrap_angle(difference[:, 2])
    blended = forward + share[:, None] * difference
    blended[:, 2] = wrap_angle(blended[:, 2])
    return blended


def _carry(poses_odom: Array, nodes: NDArray[np.int64], poses_node: Array) -> Array:
    """Rotate odometry about the position of each record's node, so that the node lies where it is corrected to."""
    turns = poses_node[:, 2] - poses_odom[nodes, 2]
    arms = poses_odom[:, :2] - poses_odom[nodes, :2]
    return compose_each(np.column_stack([poses_node[:, :2], turns]), np.column_stack([arms, poses_odom[:, 2]]))
