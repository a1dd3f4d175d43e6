"""SE(2): poses as arrays ``[x, y, theta]`` [m, m, rad], named so that frames cancel by eye.

``compose(pose_a_b, pose_b_c)`` is ``pose_a_c``; ``transform(pose_a_b, points_b)`` is ``points_a``.
Headings that these functions return are wrapped to [-pi, pi). Single poses are computed with plain floats, which take a
fraction of the time of numpy's and are needed for every record; the functions named ``each`` work on arrays of poses.
"""

import math
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

TWO_PI = 2.0 * math.pi

Array: TypeAlias = NDArray[np.float64]
"""A float64 array; the docstring that uses it gives shape, unit and frame."""

Pose: TypeAlias = NDArray[np.float64]
"""``[x, y, theta]``, shape (3,) [m, m, rad]."""


@overload
def wrap_angle(angle: float) -> float: ...
@overload
def wrap_angle(angle: Array) -> Array: ...
def wrap_angle(angle: float | Array) -> float | Array:
    """Wrap an angle, or each angle of an array, to [-pi, pi) [rad]; what is not finite becomes NaN."""
    if isinstance(angle, np.ndarray):
        wrapped = angle - TWO_PI * np.floor((angle + math.pi) / TWO_PI)
        return np.where(wrapped >= math.pi, -math.pi, wrapped)
    wrapped = (angle + math.pi) % TWO_PI - math.pi if math.isfinite(angle) else math.nan
    # The modulo of a number just below zero rounds up to the whole turn.
    return -math.pi if wrapped >= math.pi else wrapped


def _coordinates(pose_a_b: Pose) -> tuple[float, float, float]:
    """Coordinates of a pose as plain floats."""
    x, y, theta = pose_a_b.tolist()
    return x, y, theta


def pose(x: float = 0.0, y: float = 0.0, theta: float = 0.0) -> Pose:
    """Make a pose of its coordinates [m, m, rad]."""
    return np.array([x, y, wrap_angle(theta)])


def rotation(theta: float) -> Array:
    """Rotation matrix, shape (2, 2), of an angle [rad]."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s], [s, c]])


def compose(pose_a_b: Pose, pose_b_c: Pose) -> Pose:
    """Chain two poses: ``pose_a_c = pose_a_b (+) pose_b_c``."""
    x, y, theta = _coordinates(pose_a_b)
    c, s = math.cos(theta), math.sin(theta)
    dx, dy, dtheta = _coordinates(pose_b_c)
    return np.array([x + c * dx - s * dy, y + s * dx + c * dy, wrap_angle(theta + dtheta)])


def inverse(pose_a_b: Pose) -> Pose:
    """Pose of frame a in frame b."""
    x, y, theta = _coordinates(pose_a_b)
    c, s = math.cos(theta), math.sin(theta)
    return np.array([-c * x - s * y, s * x - c * y, wrap_angle(-theta)])


def between(pose_a_b: Pose, pose_a_c: Pose) -> Pose:
    """Pose of frame c in frame b: ``pose_b_c = (-) pose_a_b (+) pose_a_c``."""
    x, y, theta = _coordinates(pose_a_b)
    c, s = math.cos(theta), math.sin(theta)
    to_x, to_y, to_theta = _coordinates(pose_a_c)
    dx, dy = to_x - x, to_y - y
    return np.array([c * dx + s * dy, -s * dx + c * dy, wrap_angle(to_theta - theta)])


def transform(pose_a_b: Pose, points_b: Array) -> Array:
    """Points, shape (n, 2) or (2,) [m], of frame b in frame a."""
    return points_b @ rotation(pose_a_b[2]).T + pose_a_b[:2]


def transform_inverse(pose_a_b: Pose, points_a: Array) -> Array:
    """Points, shape (n, 2) or (2,) [m], of frame a in frame b."""
    return (points_a - pose_a_b[:2]) @ rotation(pose_a_b[2])


def rotate_each(points: Array, angles: Array | float) -> Array:
    """Rotate points, shape (n, 2) [m], about the origin, each by its own angle, shape (n,), or all by one [rad]."""
    c, s = np.cos(angles), np.sin(angles)
    x, y = points[:, 0], points[:, 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def compose_each(poses_a_b: Array, poses_b_c: Array) -> Array:
    """Chain poses row by row, shape (n, 3) each, as :func:`compose` does single ones."""
    x, y, theta = poses_a_b[:, 0], poses_a_b[:, 1], poses_a_b[:, 2]
    c, s = np.cos(theta), np.sin(theta)
    dx, dy, dtheta = poses_b_c[:, 0], poses_b_c[:, 1], poses_b_c[:, 2]
    return np.stack([x + c * dx - s * dy, y + s * dx + c * dy, wrap_angle(theta + dtheta)], axis=-1)


def compose_jacobians(pose_a_b: Pose, pose_b_c: Pose) -> tuple[Array, Array]:
    """Differentiate :func:`compose` with respect to its first and its second argument, each (3, 3)."""
    theta = float(pose_a_b[2])
    c, s = math.cos(theta), math.sin(theta)
    dx, dy, _ = _coordinates(pose_b_c)
    first = np.array([[1.0, 0.0, -s * dx - c * dy], [0.0, 1.0, c * dx - s * dy], [0.0, 0.0, 1.0]])
    second = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return first, second


def align(points_truth: Array, points_estimate: Array) -> Pose:
    """Find the rigid motion of the plane that brings one set of points nearest to another in least squares.

    Closed form of Umeyama (1991) in the plane, without scale. Where the points do not determine a heading, it is 0.

    Parameters
    ----------
    points_truth, points_estimate : shape (n, 2) each, n >= 1, row by row the same point [m].

    Returns
    -------
    pose_truth_estimate : shape (3,) [m, m, rad].
    """
    mean_truth, mean_estimate = points_truth.mean(axis=0), points_estimate.mean(axis=0)
    cov = (points_estimate - mean_estimate).T @ (points_truth - mean_truth)
    theta = float(np.arctan2(cov[0, 1] - cov[1, 0], cov[0, 0] + cov[1, 1]))
    x, y = mean_truth - rotation(theta) @ mean_estimate
    return pose(x, y, theta)
