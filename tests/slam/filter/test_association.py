"""Which corner is which landmark: gates, one to one, signatures, and what is left out."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from observed_corners import SIGMA, corners, points
from scipy.stats import chi2

from features.feature import Corners
from features.se2 import compose, pose, rotation, transform, wrap_angle
from slam.filter.association import Gates, ObservationCounts, associate
from slam.filter.association import _innovations as innovations  # the covariances that the gate works with
from slam.filter.ekf import LandmarkEkf, predict_corners

MATCH, BIRTH = float(chi2.ppf(0.99, 2)), float(chi2.ppf(0.9999, 2))


def gates(method="joint", match_probability=0.99, birth_probability=0.9999, birth_distance=0.0):
    return Gates(method, match_probability, birth_probability, birth_distance, math.radians(20.0), math.radians(30.0))


GATES = gates()
either_method = pytest.mark.parametrize("method", ["joint", "nearest"])
methods = st.sampled_from(["joint", "nearest"])

# The first association loads compiled code.
unhurried = settings(deadline=None)


def joined(*parts):
    return Corners(np.concatenate([part.records for part in parts]))


def world(landmarks_robot, pose_world_robot=pose(), pose_cov=1e-14 * np.eye(3)):  # noqa: B008, not written to
    """A filter with these corners as landmarks, placed almost without doubt, and their signatures."""
    ekf = LandmarkEkf(pose_world_robot, pose_cov)
    ekf.add_landmarks(landmarks_robot.positions, 1e-14 * np.eye(2 * len(landmarks_robot)))
    return ekf, landmarks_robot.signatures.turned(pose_world_robot[2])


def outcome(seen, known, rules=GATES, pose_world_robot=pose()):  # noqa: B008, not written to
    association = associate(seen, *world(known, pose_world_robot), rules)
    pairs = dict(zip(association.corners.tolist(), association.landmarks.tolist(), strict=True))
    return pairs, association.new.tolist()


@either_method
def test_nothing_seen_or_nothing_known(method):
    nothing, one = corners([]), corners([[1.0, 0.0]])
    assert outcome(nothing, nothing, gates(method)) == ({}, [])
    assert outcome(nothing, one, gates(method)) == ({}, [])
    assert outcome(one, nothing, gates(method)) == ({}, [0])


@either_method
@pytest.mark.parametrize(
    ("distance2", "expected"),
    [
        (MATCH * 0.999, ({0: 0}, [])),
        (MATCH * 1.001, ({}, [])),
        (BIRTH * 0.999, ({}, [])),
        (BIRTH * 1.001, ({}, [0])),
    ],
)
def test_matched_within_one_gate_new_beyond_the_other_ambiguous_between(distance2, expected, method):
    away = SIGMA * math.sqrt(distance2)
    seen = corners([[3.0 + 0.6 * away, 1.0 - 0.8 * away]])
    assert outcome(seen, corners([[3.0, 1.0]]), gates(method)) == expected


@pytest.mark.slow
@either_method
def test_the_gate_holds_its_level(method):
    """Of corners that are the landmark, 1 % lie outside the 99 % gate."""
    rng = np.random.default_rng(0)
    ekf, signatures = world(corners([[3.0, 1.0]]))
    count = 2000
    seen = rng.normal([3.0, 1.0], SIGMA, (count, 2))
    outside = sum(associate(corners(each), ekf, signatures, gates(method)).corners.size == 0 for each in seen)
    # Binomial, three standard deviations.
    assert abs(outside - 0.01 * count) < 3.0 * math.sqrt(0.01 * 0.99 * count)


@either_method
def test_a_landmark_is_matched_once_and_by_the_nearest_corner(method):
    known = corners([[3.0, 0.0]])
    pairs, new = outcome(corners([[3.0, 0.09], [3.0, 0.01]]), known, gates(method))
    assert (pairs, new) == ({1: 0}, [])


@either_method
def test_a_landmark_goes_to_the_corner_that_is_nearer_to_it(method):
    """The second corner takes the landmark that the first is nearest to; the first goes to the other one."""
    known = corners([[3.0, 0.0], [3.0, 0.12]])
    assert outcome(corners([[3.0, 0.05], [3.0, 0.01]]), known, gates(method)) == ({1: 0, 0: 1}, [])


@unhurried
@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(0, 6), methods)
def test_every_corner_is_matched_new_or_left_out_but_only_one_of_them(seed, seen, known, method):
    rng = np.random.default_rng(seed)
    landmarks = corners(rng.uniform(0.0, 0.6, (known, 2)))
    observed = corners(rng.uniform(0.0, 0.6, (seen, 2)))
    association = associate(observed, *world(landmarks), gates(method))
    assert len(set(association.landmarks)) == len(association.landmarks) == len(association.corners)
    chosen = [*association.corners, *association.new]
    assert len(set(chosen)) == len(chosen)
    assert set(chosen) <= set(range(seen))
    assert set(association.landmarks) <= set(range(known))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"openings": math.pi / 2 + math.radians(19.9)}, True),
        ({"openings": math.pi / 2 - math.radians(20.1)}, False),
        ({"orientations": 0.3 + math.radians(29.9)}, True),
        ({"orientations": 0.3 - math.radians(30.1)}, False),
        ({"orientations": 0.3 + 2.0 * math.pi}, True),
        ({"convex": True}, False),
    ],
)
def test_a_landmark_is_matched_by_a_corner_of_the_same_kind_only(change, match):
    pairs, new = outcome(corners([[3.0, 1.0]], **change), corners([[3.0, 1.0]]))
    assert (pairs, new) == (({0: 0}, []) if match else ({}, [0]))


def test_a_signature_that_does_not_fit_gives_no_new_landmark_beside_the_old_one():
    """Near a landmark of the same kind a corner of another shape is ambiguous; of the other kind it is new."""
    rules = gates(birth_distance=0.5)
    known = corners([[3.0, 1.0]])
    assert outcome(corners([[3.0, 1.49]], orientations=2.0), known, rules) == ({}, [])
    assert outcome(corners([[3.0, 1.51]], orientations=2.0), known, rules) == ({}, [0])
    assert outcome(corners([[3.0, 1.0]], convex=True), known, rules) == ({}, [0])


@unhurried
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_orientations_are_compared_in_the_world(heading, turn):
    """A landmark is found again after the robot has turned, also across the cut."""
    known = corners([[3.0, 1.0]])
    ekf, signatures = world(known, pose(1.0, 2.0, heading))
    ekf.predict(pose(0.0, 0.0, turn))
    seen = corners(predict_corners(ekf.x, np.array([0])), orientations=wrap_angle(0.3 - turn))
    association = associate(seen, ekf, signatures, GATES)
    assert association.landmarks.tolist() == [0]


@unhurried
@given(st.integers(0, 10_000), methods)
def test_association_does_not_depend_on_the_world_frame(seed, method):
    rng = np.random.default_rng(seed)
    known, seen = corners(rng.uniform(0.0, 2.0, (5, 2))), corners(rng.uniform(0.0, 2.0, (5, 2)))
    g = pose(*rng.normal(0.0, 10.0, 2), rng.uniform(-math.pi, math.pi))
    assert outcome(seen, known, gates(method)) == outcome(seen, known, gates(method), g)


@pytest.mark.slow
@given(st.integers(0, 10_000), st.floats(-math.pi, math.pi))
def test_innovation_covariances_are_those_of_the_filter(seed, heading):
    """For one corner and one landmark, the gate's covariance is the S that the filter forms when it is observed."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.1, (3, 3))
    ekf = LandmarkEkf(pose(1.0, -2.0, heading), root @ root.T)
    for _ in range(3):
        ekf.add_landmarks(rng.uniform(-4.0, 4.0, (1, 2)), 0.01 * np.eye(2))
        ekf.Q = np.diag(rng.uniform(0.0, 0.01, 3))
        ekf.predict(pose(*rng.normal(0.0, 0.5, 3)))
    seen = corners(rng.uniform(-4.0, 4.0, (2, 2)))
    differences, covs = innovations(seen, ekf)
    x, P = ekf.x, ekf.P
    for corner in range(2):
        for landmark in range(3):
            ekf.x, ekf.P = x, P
            ekf.observe(seen.positions[[corner]], seen.covs[[corner]], np.array([landmark]))
            np.testing.assert_allclose(covs[corner, landmark], ekf.S, rtol=0, atol=1e-12)
            np.testing.assert_allclose(differences[corner, landmark], ekf.y, rtol=0, atol=1e-12)


def test_a_doubtful_pose_widens_the_gate():
    known = corners([[5.0, 0.0]])
    seen = corners([[5.0, 0.4]])
    sure = associate(seen, *world(known), GATES)
    ekf, signatures = world(known)
    ekf.Q = np.diag([0.0, 0.0, 0.05**2])
    ekf.predict(pose())
    doubtful = associate(seen, ekf, signatures, GATES)
    assert (sure.landmarks.tolist(), doubtful.landmarks.tolist()) == ([], [0])


def test_mixed_corners_each_find_their_own():
    known = joined(corners([[2.0, 0.0]]), corners([[2.0, 0.05]], convex=True), corners([[0.0, 3.0]], orientations=-2.0))
    seen = joined(
        corners([[0.02, 3.0]], orientations=-2.1), corners([[2.0, 0.0]], convex=True), corners([[-4.0, -4.0]])
    )
    assert outcome(seen, known) == ({0: 2, 1: 1}, [2])


def test_a_corner_seen_from_elsewhere_is_the_same_landmark():
    known = corners([[3.0, 1.0], [3.0, -1.0]])
    ekf, signatures = world(known, pose(2.0, 1.0, 3.0))
    landmarks_world = transform(ekf.pose, known.positions)
    motion = pose(0.7, -0.2, 0.4)
    ekf.predict(motion)
    back = compose(pose(2.0, 1.0, 3.0), motion)
    seen = corners((landmarks_world - back[:2]) @ rotation(back[2]), orientations=0.3 - 0.4)
    assert associate(seen, ekf, signatures, GATES).landmarks.tolist() == [0, 1]


@either_method
def test_a_matched_corner_is_never_new_whatever_the_gates(method):
    rules = gates(method, birth_probability=0.0)
    assert outcome(corners([[3.0, 1.01]]), corners([[3.0, 1.0]]), rules) == ({0: 0}, [])


@either_method
@pytest.mark.parametrize("seed", range(4))
def test_the_distance_of_all_pairs_together_is_that_of_the_update(method, seed):
    """Innovations share the doubt about the pose: their joint distance is that of the S that the filter forms."""
    rng = np.random.default_rng(seed)
    known = corners(rng.uniform(-4.0, 4.0, (4, 2)))
    ekf, signatures = world(known, pose(1.0, -2.0, 2.0))
    ekf.Q = np.diag([0.1, 0.1, 0.03]) ** 2
    ekf.predict(pose())
    shift = rng.multivariate_normal(np.zeros(3), ekf.Q)
    seen = corners((known.positions - shift[:2]) @ rotation(shift[2]) + rng.normal(0.0, SIGMA, (4, 2)))
    association = associate(seen, ekf, signatures, gates(method))
    assert association.corners.size >= 2
    ekf.observe(seen.positions[association.corners], seen.covs[association.corners], association.landmarks)
    assert association.nis == pytest.approx(ekf.mahalanobis**2, rel=1e-9)


def test_a_robot_that_is_half_a_metre_off_is_understood_by_joint_compatibility_only():
    """A row of alike niches 0.5 m apart: each corner alone is nearest to its neighbour, the corner beside tells."""
    known = corners([[3.0, 0.0], [3.0, 0.5], [3.0, 1.0], [3.0, 1.5], [1.0, -3.0], [-1.0, 2.5]])
    ekf, signatures = world(known)
    ekf.Q = np.diag([0.01, 0.25, 1e-3]) ** 2
    ekf.predict(pose())
    truth = pose(0.0, -0.4, 0.0)
    seen = corners(known.positions[[0, 1, 2, 4, 5]] - truth[:2])
    joint = associate(seen, ekf, signatures, gates("joint"))
    nearest = associate(seen, ekf, signatures, gates("nearest"))
    true_pairs = {0: 0, 1: 1, 2: 2, 3: 4, 4: 5}
    assert dict(zip(joint.corners.tolist(), joint.landmarks.tolist(), strict=True)) == true_pairs
    assert dict(zip(nearest.corners.tolist(), nearest.landmarks.tolist(), strict=True)) != true_pairs
    ekf.observe(seen.positions[joint.corners], seen.covs[joint.corners], joint.landmarks)
    np.testing.assert_allclose(ekf.pose, truth, atol=3.0 * SIGMA)


def test_joint_compatibility_is_right_more_often_than_the_nearest_neighbour():
    """Random scenes with neighbours nearer than the doubt about the pose; how many pairs are the true ones."""
    rng = np.random.default_rng(0)
    true_pairs, wrong_pairs = {"joint": 0, "nearest": 0}, {"joint": 0, "nearest": 0}
    for _ in range(60):
        known = corners(rng.uniform(-3.0, 3.0, (12, 2)))
        ekf, signatures = world(known)
        ekf.Q = np.diag([0.2, 0.2, 0.05]) ** 2
        ekf.predict(pose())
        shift = rng.multivariate_normal(np.zeros(3), ekf.Q)
        which = rng.choice(12, 8, replace=False)
        positions = (known.positions[which] - shift[:2]) @ rotation(shift[2]) + rng.normal(0.0, 0.02, (8, 2))
        seen = corners(positions, sigma=0.02)
        for method in true_pairs:
            association = associate(seen, ekf, signatures, gates(method))
            right = which[association.corners] == association.landmarks
            true_pairs[method] += int(right.sum())
            wrong_pairs[method] += int((~right).sum())
    assert true_pairs["joint"] > 0.95 * 60 * 8
    assert wrong_pairs["joint"] < 0.2 * wrong_pairs["nearest"]


@either_method
def test_two_points_without_signature_that_are_seen_at_once_are_two_however_near(method):
    """A corner beside one that is matched may be half of it; a point, such as a barcode, stands for itself."""
    rules = gates(method, birth_distance=0.5)
    positions = [[2.0, 1.0], [2.3, 1.0]]
    known, seen = ([[2.0, 1.0]], positions)
    assert outcome(points(seen), points(known), rules) == ({0: 0}, [1])
    assert outcome(corners(seen), corners(known), rules) == ({0: 0}, [])
    # Alone it is too near to what was not seen just now to be another one.
    lone = points([[2.3, 1.0]])
    assert outcome(lone, points(known), rules) == ({}, [])


@either_method
def test_each_corner_is_counted_once_also_a_point_that_is_new_within_the_gate_of_another(method):
    known = world(points([[2.0, 1.0]]))
    seen = points([[2.0, 1.0], [2.05, 1.0], [2.3, 1.0]])
    association = associate(seen, *known, gates(method, birth_distance=0.5))
    assert (association.corners.tolist(), association.new.tolist(), association.ambiguous) == ([0], [1, 2], 0)
    counts = ObservationCounts()
    counts.add(len(seen), association)
    assert (counts.matched, counts.new, counts.ambiguous, counts.gated_out) == (1, 2, 0, 0)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_pairs_hold_together_up_to_chi_square_of_all_their_degrees_of_freedom(count):
    """Corners far apart, each off by as much: independent, so their distances add up to the joint one."""
    known = corners([[3.0 * k, 1.0] for k in range(count)])
    gate = float(chi2.ppf(0.99, 2 * count))
    for off2, matched in ((0.99 * gate, count), (1.01 * gate, count - 1)):
        seen = corners(known.positions + np.array([SIGMA * math.sqrt(off2 / count), 0.0]))
        association = associate(seen, *world(known), gates())
        assert len(association.corners) == matched
        # Landmark and robot are almost without doubt, to 1e-14 of a square metre.
        assert association.nis == pytest.approx(matched * off2 / count, rel=1e-6)


def test_a_scan_may_have_any_number_of_corners():
    """The gate of six hundred pairs together is that of their degrees of freedom."""
    side = np.arange(25.0)
    known = corners(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)[:600])
    pairs, new = outcome(known, known, gates())
    assert pairs == {k: k for k in range(600)}
    assert new == []
    limits = gates()
    for most in (1, 600, 20):
        assert limits.joint(most)[most] == chi2.ppf(0.99, 2 * most)
