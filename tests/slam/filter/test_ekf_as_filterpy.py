"""The filter driven as any of filterpy's: through the interface of ExtendedKalmanFilter and nothing else."""

import copy

import numpy as np
import pytest
from filterpy.common import Saver
from filterpy.kalman import ExtendedKalmanFilter
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal

from features.se2 import compose, compose_jacobians, wrap_angle
from slam.filter.ekf import LandmarkEkf, corner_jacobian, predict_corners

MOTION, MOTION_COV = np.array([0.3, -0.05, 0.2]), np.diag([0.02, 0.01, 0.03]) ** 2
NOISE = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])


class Dense(ExtendedKalmanFilter):
    """filterpy's own filter, told of the motion by overriding what filterpy says is to be overridden."""

    def predict_x(self, u=0):
        u = np.zeros(3) if np.isscalar(u) else u
        by_pose, by_motion = compose_jacobians(self.x[:3], u)
        rest = self.dim_x - 3
        self.F = block_diag(by_pose, np.eye(rest))
        self.Q = block_diag(by_motion @ self.motion_cov @ by_motion.T, np.zeros((rest, rest)))
        self.x = np.concatenate([compose(self.x[:3], u), self.x[3:]])

    def predict_update(self, z, HJacobian, Hx, args=(), hx_args=(), u=0):
        self.predict(u)
        self.update(z, HJacobian, Hx, args=args, hx_args=hx_args)


def jacobian(x, landmark):
    return corner_jacobian(x, np.array([landmark])).toarray()


def predicted(x, landmark):
    return predict_corners(x, np.array([landmark])).ravel()


def residual(z, expected):
    return z - expected


@pytest.fixture
def filters():
    """Ours and filterpy's, of one state with two landmarks."""
    ours = LandmarkEkf(np.array([1.0, 2.0, 0.5]), np.diag([0.1, 0.1, 0.05]) ** 2)
    ours.add_landmarks(np.array([[2.0, 1.0], [-1.0, 3.0]]), np.diag([0.05, 0.04, 0.03, 0.06]) ** 2)
    dense = Dense(dim_x=7, dim_z=2)
    dense.x, dense.P = ours.x.copy(), ours.P.copy()
    ours.Q, dense.motion_cov = MOTION_COV, MOTION_COV
    ours.R = dense.R = NOISE
    return ours, dense


def steps(kf):
    """What a user of filterpy does with a filter."""
    z = np.array([1.9, 0.8])
    kf.predict(MOTION)
    kf.update(z, jacobian, predicted, args=(0,), hx_args=(0,))
    kf.predict()
    kf.update(z + 0.1, jacobian, predicted, R=2.0 * NOISE, args=0, hx_args=0, residual=residual)
    kf.update(None, jacobian, predicted)
    kf.predict_update(np.array([-1.2, 2.7]), jacobian, predicted, args=(1,), hx_args=1, u=MOTION)
    kf.update(np.array([-1.1, 2.8]), jacobian, predicted, R=0.01, args=1, hx_args=1)


def test_every_step_of_filterpys_interface_gives_filterpys_numbers(filters):
    ours, dense = filters
    steps(ours)
    steps(dense)
    assert ours.x == pytest.approx(np.append([*dense.x[:2], wrap_angle(dense.x[2])], dense.x[3:]), abs=1e-12)
    for name in ("P", "K", "S", "SI", "y", "z", "x_prior", "P_prior", "x_post", "P_post"):
        assert getattr(ours, name) == pytest.approx(getattr(dense, name), abs=1e-12), name
    assert ours.mahalanobis == pytest.approx(dense.mahalanobis, rel=1e-9)
    assert ours.log_likelihood == pytest.approx(dense.log_likelihood, rel=1e-9)


def test_predict_x_moves_the_state_and_leaves_the_covariance(filters):
    ours, dense = filters
    before = ours.P.copy()
    ours.predict_x(MOTION)
    dense.predict_x(MOTION)
    assert ours.x == pytest.approx(dense.x, abs=1e-15)
    assert (before == ours.P).all()


def test_likelihood_and_mahalanobis_are_those_of_the_innovation(filters):
    ours, _ = filters
    z = np.array([1.9, 0.8])
    before = copy.deepcopy(ours)
    ours.update(z, jacobian, predicted, args=0, hx_args=0)
    H = jacobian(before.x, 0)
    innovation = multivariate_normal(predicted(before.x, 0), H @ before.P @ H.T + NOISE)
    assert ours.log_likelihood == pytest.approx(innovation.logpdf(z), rel=1e-9)
    assert ours.likelihood == pytest.approx(innovation.pdf(z), rel=1e-9)
    misfit = z - innovation.mean
    assert ours.mahalanobis == pytest.approx(np.sqrt(misfit @ np.linalg.solve(innovation.cov, misfit)), rel=1e-9)


def test_no_measurement_changes_nothing(filters):
    ours, _ = filters
    ours.predict(MOTION)
    x, P = ours.x.copy(), ours.P.copy()
    ours.update(None, jacobian, predicted)
    assert (ours.x == x).all()
    assert (ours.P == P).all()
    assert (ours.x_post == x).all()
    assert ours.z.tolist() == [[None], [None]]


def test_filterpys_saver_keeps_each_step_and_a_filter_prints_itself(filters):
    ours, _ = filters
    saver = Saver(ours)
    poses = []
    for _ in range(3):
        ours.predict(MOTION)
        ours.update(np.array([1.9, 0.8]), jacobian, predicted, args=0, hx_args=0)
        saver.save()
        poses.append(ours.pose)
    assert np.array(saver.x)[:, :3] == pytest.approx(np.array(poses), abs=0.0)
    assert np.array(saver.P).shape == (3, 7, 7)
    assert saver.likelihood == [kept for kept in saver.likelihood if kept > 0.0]
    assert "x_prior" in repr(ours)
