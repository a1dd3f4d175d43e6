"""Ready-made observations through the engine: against a batch solve of GTSAM, without identities, and on real data."""

import itertools
import math

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import L, X
from places import DATA

from drivers.data_sets.mrclam import MrclamLog
from drivers.frame import Frame, LandmarkObservations
from features.se2 import between, compose, pose, transform, transform_inverse
from features.sensor import Mounting, SensorModel
from slam.config import SlamConfig, without_identities
from slam.errors import ConfigError
from slam.evaluation.evaluate import evaluate_truth
from slam.filter.association import Gates
from slam.filter.front_end import FrontEnd
from slam.observed import observed_points
from slam.odometry.motion_models import OdometryModel
from slam.pipeline import Slam

MRCLAM = DATA / "mrclam6"
SIGMA_RANGE, SIGMA_BEARING = 0.05, 0.01
LANDMARKS = np.array([[4.0, 1.0], [1.0, 6.0], [-5.0, 2.0], [-1.0, -5.0], [6.0, -4.0], [7.0, 7.0]])
IDENTITIES = np.array([11, 3, 5, 42, 8, 0])


def drive(seed, turns=120):
    """Frames of a robot that goes round twice and sees all landmarks within 8 m, with noise as it is modelled."""
    rng = np.random.default_rng(seed)
    true, odom = pose(3.0, 0.0, math.pi / 2), pose()
    step = pose(0.3, 0.0, 0.105)
    model = odometry_model()
    for k in range(turns):
        seen = transform_inverse(true, LANDMARKS)
        ranges = np.hypot(*seen.T)
        near = np.flatnonzero(ranges < 8.0)
        yield Frame(
            float(k),
            odom,
            observations=LandmarkObservations(
                ranges[near] + rng.normal(0.0, SIGMA_RANGE, near.size),
                np.arctan2(seen[near, 1], seen[near, 0]) + rng.normal(0.0, SIGMA_BEARING, near.size),
                np.tile(np.diag([SIGMA_RANGE, SIGMA_BEARING]) ** 2, (near.size, 1, 1)),
                IDENTITIES[near],
            ),
        )
        true = compose(true, step)
        odom = compose(odom, step + np.sqrt(np.diag(model.covariance(step))) * rng.normal(size=3))


def odometry_model():
    odometry = SlamConfig.of_preset("sick-lms").odometry
    return OdometryModel(
        odometry.position_per_travel,
        odometry.position_per_turn,
        math.radians(odometry.heading_per_travel_deg),
        math.radians(odometry.heading_per_turn_deg),
    )


def mapped(frames, config=None):
    slam = Slam(config or SlamConfig.of_preset("sick-lms"))
    for frame in frames:
        slam.process(frame)
    return slam.finish(), slam


@pytest.mark.parametrize("seed", [1, 2])
def test_with_identities_the_engine_finds_the_batch_solution(seed):
    frames = list(drive(seed))
    result, _ = mapped(frames)
    assert sorted(result.landmarks.identities.tolist()) == sorted(IDENTITIES.tolist())

    graph, guess, model = gtsam.NonlinearFactorGraph(), gtsam.Values(), odometry_model()
    kernel = gtsam.noiseModel.mEstimator.Cauchy.Create(SlamConfig.of_preset("sick-lms").back_end.cauchy_scale)
    noise = gtsam.noiseModel.Robust.Create(
        kernel, gtsam.noiseModel.Diagonal.Sigmas(np.array([SIGMA_BEARING, SIGMA_RANGE]))
    )
    graph.add(gtsam.PriorFactorPose2(X(0), gtsam.Pose2(), gtsam.noiseModel.Isotropic.Sigma(3, 1e-5)))
    for k, frame in enumerate(frames):
        guess.insert(X(k), gtsam.Pose2(*frame.pose_odom_robot))
        if k:
            motion = between(frames[k - 1].pose_odom_robot, frame.pose_odom_robot)
            # The covariance is of the motion's coordinates, GTSAM's of an error in the frame of its end.
            turn = np.eye(3)
            turn[:2, :2] = gtsam.Rot2(motion[2]).matrix().T
            cov = gtsam.noiseModel.Gaussian.Covariance(turn @ model.covariance(motion) @ turn.T)
            graph.add(gtsam.BetweenFactorPose2(X(k - 1), X(k), gtsam.Pose2(*motion), cov))
        seen = frame.observations
        for r, b, identity in zip(seen.ranges, seen.bearings, seen.identities.tolist(), strict=True):
            if not guess.exists(L(identity)):
                at = transform(frame.pose_odom_robot, r * np.array([math.cos(b), math.sin(b)]))
                guess.insert(L(identity), at)
            graph.add(gtsam.BearingRangeFactor2D(X(k), L(identity), gtsam.Rot2(b), r, noise))
    batch = gtsam.LevenbergMarquardtOptimizer(graph, guess).optimize()
    expected = np.array([batch.atPoint2(L(i)) for i in result.landmarks.identities.tolist()])
    # Both stop where the cost falls by less than 1e-5 of itself; a hundredth of a sigma of a single range is far above.
    np.testing.assert_allclose(result.landmarks.positions, expected, atol=0.01 * SIGMA_RANGE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_withheld_identities_make_no_difference_where_landmarks_are_far_apart(seed):
    known, _ = mapped(drive(seed))
    withheld, _ = mapped(drive(seed), without_identities(SlamConfig.of_preset("sick-lms")))
    assert (withheld.landmarks.identities == -1).all()
    assert len(withheld.landmarks) == len(known.landmarks) == len(LANDMARKS)
    order = [np.hypot(*(withheld.landmarks.positions - at).T).argmin() for at in known.landmarks.positions]
    # A true match beyond the gate (1 in 100) is used with identities only: a few of several hundred observations.
    np.testing.assert_allclose(withheld.landmarks.positions[order], known.landmarks.positions, atol=SIGMA_RANGE)


def test_a_misread_identity_does_not_move_the_filter():
    gates = Gates("joint", 0.99, 0.9999, 0.5, math.radians(20.0), math.radians(30.0))
    front = FrontEnd(pose(), np.diag([0.1, 0.1, 0.05]) ** 2, gates, 20.0)
    sensor = SensorModel(0.05, 0.01, 0.0, 30.0)

    def see(*bearings, identities):
        front.move(pose(), 0.05**2 * np.eye(3))
        observed = LandmarkObservations(np.full(len(bearings), 4.0), np.array(bearings), identities=identities)
        return front.observe(*observed_points(observed, sensor))

    see(0.0, 2.0, identities=np.array([1, 2]))
    before = front.ekf.pose
    see(-2.0, identities=np.array([1]))
    assert np.hypot(*(front.ekf.pose - before)[:2]) < 0.05
    # One within the gate is believed: the bearing tells more of the heading than was known of it.
    see(0.06, identities=np.array([1]))
    assert abs(front.ekf.pose[2] - before[2]) > 0.02


def test_points_near_each_other_stay_two_when_they_were_seen_at_once():
    gates = Gates("joint", 0.99, 0.9999, 0.5, math.radians(20.0), math.radians(30.0))
    front = FrontEnd(pose(), 1e-6 * np.eye(3), gates, 20.0)
    pair = LandmarkObservations(np.array([4.0, 4.0]), np.array([0.0, 0.03]))
    points, identities = observed_points(pair, SensorModel(0.15, 0.02, 0.0, 30.0))
    front.observe(points, identities)
    assert front.merge() == []
    one = LandmarkObservations(np.array([6.0]), np.array([1.0]))
    front.observe(*observed_points(one, SensorModel(0.15, 0.02, 0.0, 30.0)))
    both = LandmarkObservations(np.array([6.0, 6.0]), np.array([1.0, 1.06]))
    _, landmarks = front.observe(*observed_points(both, SensorModel(0.15, 0.02, 0.0, 30.0)))
    # The second is within the birth distance of the first, but the first is there beside it.
    assert sorted(landmarks.tolist()) == [2, 3]


def test_points_know_the_mounting_the_limits_and_the_noise_of_the_sensor():
    sensor = SensorModel(0.1, 0.02, 1.0, 5.0, Mounting(1.0, 2.0, math.pi / 2))
    seen = LandmarkObservations(np.array([0.5, 4.0, 6.0]), np.array([0.0, 0.0, 0.0]), identities=np.array([1, 2, 3]))
    points, identities = observed_points(seen, sensor)
    assert identities.tolist() == [2]
    np.testing.assert_allclose(points.positions, [[1.0, 6.0]])
    # Along the beam, the robot's y axis, the range tells; across it the bearing at 4 m.
    np.testing.assert_allclose(points.covs[0], np.diag([0.08**2, 0.1**2]), atol=1e-12)


@pytest.mark.slow
def test_a_landmark_at_rest_comes_back_by_its_identity():
    config = SlamConfig.of_preset("sick-lms")
    far = config.model_copy(update={"front_end": config.front_end.model_copy(update={"keep_distance_m": 3.0})})
    result, slam = mapped(drive(4), far)
    everything, _ = mapped(drive(4))
    assert sorted(result.landmarks.identities.tolist()) == sorted(IDENTITIES.tolist())
    assert len(slam.landmarks) <= len(IDENTITIES)
    # The graph gets each observation once whatever the filter keeps.
    np.testing.assert_allclose(result.landmarks.positions, everything.landmarks.positions, atol=1e-3)


def test_observations_need_wheels():
    config = SlamConfig.of_preset("sick-lms")
    lines = config.model_copy(update={"odometry": config.odometry.model_copy(update={"source": "lines"})})
    with pytest.raises(ConfigError, match=r"odometry\.source is 'lines', but the source has no scans"):
        mapped(drive(1), lines)


def test_observations_are_checked():
    with pytest.raises(ValueError, match="one shape"):
        LandmarkObservations(np.ones(2), np.ones(3))
    with pytest.raises(ValueError, match="not positive"):
        LandmarkObservations(np.zeros(1), np.zeros(1))
    with pytest.raises(ValueError, match="positive definite"):
        LandmarkObservations(np.ones(1), np.zeros(1), np.zeros((1, 2, 2)))
    with pytest.raises(ValueError, match="none negative"):
        LandmarkObservations(np.ones(1), np.zeros(1), identities=np.array([-1]))


@pytest.mark.slow
@pytest.mark.skipif(not MRCLAM.is_dir(), reason=f"{MRCLAM} is absent: set CWLF_DATA to the folder of the real logs")
def test_a_piece_of_mrclam_is_mapped_to_the_survey():
    """The first 160 s see all 15 landmarks."""
    log = MrclamLog(MRCLAM)
    start = next(iter(log)).stamp
    result, _ = mapped(
        itertools.takewhile(lambda frame: frame.stamp < start + 160.0, log), SlamConfig.of_preset(log.sensor)
    )
    report = evaluate_truth(MRCLAM, result.trajectory, result.landmarks.positions, result.landmarks.identities)
    assert report["landmarks"]["surveyed_mapped"] >= 10
    assert report["landmarks"]["rmse_m"] < 0.18
    assert report["ate"]["rmse_m"] < 0.25
