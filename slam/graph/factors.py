"""Factors of the graph in GTSAM's coordinates."""

import math

import gtsam
import numpy as np
from gtsam.symbol_shorthand import L, X

from features.se2 import Array, Pose, rotation
from slam.graph.values import Closure


def anchor_factor(pose_world_robot: Pose, sigmas: Array) -> gtsam.PriorFactorPose2:
    """First key frame, where it defines the world frame, with sigmas of its pose, shape (3,)."""
    return gtsam.PriorFactorPose2(X(0), gtsam.Pose2(*pose_world_robot), gtsam.noiseModel.Diagonal.Sigmas(sigmas))


def odometry_factor(key: int, motion: Pose, cov: Array) -> gtsam.BetweenFactorPose2:
    """Motion to a key frame from the one before, shape (3,), with the covariance of its coordinates."""
    return gtsam.BetweenFactorPose2(X(key - 1), X(key), gtsam.Pose2(*motion), _noise(motion, cov))


def closure_factor(closure: Closure) -> gtsam.BetweenFactorPose2:
    """Loop closure without robust kernel, which would give a right closure after a long drift too little weight."""
    motion = closure.motion
    return gtsam.BetweenFactorPose2(
        X(closure.older), X(closure.newer), gtsam.Pose2(*motion), _noise(motion, closure.cov)
    )


def corner_factor(
    key: int, landmark: int, position_robot: Array, cov: Array, kernel: gtsam.noiseModel.mEstimator.Base
) -> gtsam.BearingRangeFactor2D:
    """Corner observation, bearing and range, with the whole covariance and a robust kernel (eq. M19)."""
    x, y = position_robot.tolist()
    rho = math.hypot(x, y)
    to_polar = np.array([[-y / rho**2, x / rho**2], [x / rho, y / rho]])
    noise = gtsam.noiseModel.Gaussian.Covariance(to_polar @ cov @ to_polar.T)
    return gtsam.BearingRangeFactor2D(
        X(key), L(landmark), gtsam.Rot2.atan2(y, x), rho, gtsam.noiseModel.Robust.Create(kernel, noise)
    )


def _noise(motion: Pose, cov: Array) -> gtsam.noiseModel.Gaussian:
    """Covariance of a motion's coordinates for GTSAM, which takes the error of a motion in the frame of its end."""
    to_end = np.eye(3)
    to_end[:2, :2] = rotation(motion[2]).T
    return gtsam.noiseModel.Gaussian.Covariance(to_end @ cov @ to_end.T)


def empty_tree(relinearize: float, relinearize_skip: int) -> gtsam.ISAM2:
    """Tree that is eliminated by QR, iSAM2's and from Python GTSAM's only way to marginals of a long open way.

    Parameters
    ----------
    relinearize : change of a variable with which its factors are linearised anew [m, rad].
    relinearize_skip : updates from one look at these changes to the next.
    """
    params = gtsam.ISAM2Params()
    params.setFactorization("QR")
    params.setRelinearizeThreshold(relinearize)  # pyright: ignore[reportUnknownMemberType]  # GTSAM leaves arguments untyped
    params.relinearizeSkip = relinearize_skip
    return gtsam.ISAM2(params)
