"""Which corner is which landmark: gates, one to one, signatures, and what is left out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from features.feature import Corners
from features.se2 import compose, pose, transform, wrap_angle
from slam.association import Gates, associate
from slam.association import _innovations as innovations  # the covariances that the gate works with
from slam.ekf import LandmarkEkf, predict_corners
from slam.landmark import LandmarkTable

SIGMA = 0.05
GATES = Gates(
    match=float(chi2.ppf(0.99, 2)),
    birth=float(chi2.ppf(0.9999, 2)),
    birth_distance=0.0,
    opening=math.radians(20.0),
    orientation=math.radians(30.0),
)


def corners(positions, openings=math.pi / 2, orientations=0.3, convex=False, sigma=SIGMA):
    positions = np.array(positions, dtype=np.float64).reshape(-1, 2)
    k = len(positions)
    return Corners.of(
        positions,
        np.repeat(sigma**2 * np.eye(2)[None], k, axis=0),
        np.full(k, openings, dtype=np.float64),
        np.full(k, orientations, dtype=np.float64),
        np.full(k, convex),
    )


def joined(*parts):
    return Corners.of(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("positions", "covs", "opening_angles", "orientations", "convex")
        )
    )


def world(landmarks_robot, pose_world_robot=pose(), pose_cov=1e-14 * np.eye(3)):  # noqa: B008, not written to
    """A filter and its table with these corners as landmarks, placed almost without doubt."""
    ekf, table = LandmarkEkf(pose_world_robot, pose_cov), LandmarkTable()
    if len(landmarks_robot):
        ekf.add_landmarks(landmarks_robot.positions, 1e-12 * landmarks_robot.covs)
        table.add(landmarks_robot, np.arange(len(landmarks_robot)), ekf.x[2])
    return ekf, table


def outcome(seen, known, gates=GATES, pose_world_robot=pose()):  # noqa: B008, not written to
    association = associate(seen, *world(known, pose_world_robot), gates)
    pairs = dict(zip(association.corners.tolist(), association.landmarks.tolist(), strict=True))
    return pairs, association.new.tolist()


def test_nothing_seen_or_nothing_known():
    nothing, one = corners([]), corners([[1.0, 0.0]])
    assert outcome(nothing, nothing) == ({}, [])
    assert outcome(nothing, one) == ({}, [])
    assert outcome(one, nothing) == ({}, [0])


@pytest.mark.parametrize(
    ("distance2", "expected"),
    [
        (GATES.match * 0.999, ({0: 0}, [])),
        (GATES.match * 1.001, ({}, [])),
        (GATES.birth * 0.999, ({}, [])),
        (GATES.birth * 1.001, ({}, [0])),
    ],
)
def test_matched_within_one_gate_new_beyond_the_other_ambiguous_between(distance2, expected):
    away = SIGMA * math.sqrt(distance2)
    assert outcome(corners([[3.0 + 0.6 * away, 1.0 - 0.8 * away]]), corners([[3.0, 1.0]])) == expected


def test_the_gate_holds_its_level():
    """Of corners that are the landmark, 1 % lie outside the 99 % gate."""
    rng = np.random.default_rng(0)
    ekf, table = world(corners([[3.0, 1.0]]))
    count = 4000
    seen = rng.normal([3.0, 1.0], SIGMA, (count, 2))
    outside = sum(len(associate(corners(position), ekf, table, GATES).corners) == 0 for position in seen)
    # Binomial, three standard deviations.
    assert abs(outside - 0.01 * count) < 3.0 * math.sqrt(0.01 * 0.99 * count)


def test_a_landmark_is_matched_once_and_the_nearest_pair_goes_first():
    known = corners([[3.0, 0.0]])
    pairs, new = outcome(corners([[3.0, 0.09], [3.0, 0.01]]), known)
    assert (pairs, new) == ({1: 0}, [])


def test_nearest_pair_first_is_not_nearest_landmark_first():
    """The second corner takes the landmark that the first is nearest to; the first goes to the other one."""
    known = corners([[3.0, 0.0], [3.0, 0.12]])
    assert outcome(corners([[3.0, 0.05], [3.0, 0.01]]), known) == ({1: 0, 0: 1}, [])


@given(st.integers(0, 10_000), st.integers(0, 6), st.integers(0, 6))
def test_every_corner_is_matched_new_or_left_out_but_only_one_of_them(seed, seen, known):
    rng = np.random.default_rng(seed)
    landmarks = corners(rng.uniform(0.0, 0.6, (known, 2)))
    observed = corners(rng.uniform(0.0, 0.6, (seen, 2)))
    association = associate(observed, *world(landmarks), GATES)
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
    gates = Gates(GATES.match, GATES.birth, 0.5, GATES.opening, GATES.orientation)
    known = corners([[3.0, 1.0]])
    assert outcome(corners([[3.0, 1.49]], orientations=2.0), known, gates) == ({}, [])
    assert outcome(corners([[3.0, 1.51]], orientations=2.0), known, gates) == ({}, [0])
    assert outcome(corners([[3.0, 1.0]], convex=True), known, gates) == ({}, [0])


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi, math.pi))
def test_orientations_are_compared_in_the_world(heading, turn):
    """A landmark is found again after the robot has turned, also across the cut."""
    known = corners([[3.0, 1.0]])
    ekf, table = world(known, pose(1.0, 2.0, heading))
    ekf.predict(pose(0.0, 0.0, turn))
    seen = corners(predict_corners(ekf.x, np.array([0])), orientations=wrap_angle(0.3 - turn))
    association = associate(seen, ekf, table, GATES)
    assert association.landmarks.tolist() == [0]


@given(st.integers(0, 10_000))
def test_association_does_not_depend_on_the_world_frame(seed):
    rng = np.random.default_rng(seed)
    known, seen = corners(rng.uniform(0.0, 2.0, (5, 2))), corners(rng.uniform(0.0, 2.0, (5, 2)))
    g = pose(*rng.normal(0.0, 10.0, 2), rng.uniform(-math.pi, math.pi))
    assert outcome(seen, known) == outcome(seen, known, pose_world_robot=g)


@given(st.integers(0, 10_000), st.floats(-math.pi, math.pi))
def test_innovation_covariances_are_those_of_the_filter(seed, heading):
    """For one corner and one landmark, the gate's covariance is the S that the filter forms when it is observed."""
    rng = np.random.default_rng(seed)
    root = rng.normal(0.0, 0.1, (3, 3))
    ekf = LandmarkEkf(pose(1.0, -2.0, heading), root @ root.T)
    for _ in range(3):
        ekf.add_landmarks(rng.uniform(-4.0, 4.0, (1, 2)), 0.01 * np.eye(2)[None])
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
    ekf, table = world(known)
    ekf.Q = np.diag([0.0, 0.0, 0.05**2])
    ekf.predict(pose())
    doubtful = associate(seen, ekf, table, GATES)
    assert (sure.landmarks.tolist(), doubtful.landmarks.tolist()) == ([], [0])


def test_mixed_corners_each_find_their_own():
    known = joined(corners([[2.0, 0.0]]), corners([[2.0, 0.05]], convex=True), corners([[0.0, 3.0]], orientations=-2.0))
    seen = joined(
        corners([[0.02, 3.0]], orientations=-2.1), corners([[2.0, 0.0]], convex=True), corners([[-4.0, -4.0]])
    )
    assert outcome(seen, known) == ({0: 2, 1: 1}, [2])


def test_signatures_are_means_over_the_observations():
    table = LandmarkTable()
    first = corners([[1.0, 0.0]], openings=1.5, orientations=math.pi - 0.1)
    second = corners([[1.0, 0.0]], openings=1.7, orientations=-math.pi + 0.3)
    assert table.add(first, np.array([0]), 0.0).tolist() == [0]
    table.see(np.array([0]), second, np.array([0]), 0.0)
    assert table.observations.tolist() == [2]
    assert table.opening_angles == pytest.approx([1.6])
    assert wrap_angle(table.orientations - (-math.pi + 0.1)) == pytest.approx([0.0], abs=1e-9)


def test_a_corner_seen_from_elsewhere_is_the_same_landmark():
    known = corners([[3.0, 1.0], [3.0, -1.0]])
    ekf, table = world(known, pose(2.0, 1.0, 3.0))
    landmarks_world = transform(ekf.pose, known.positions)
    motion = pose(0.7, -0.2, 0.4)
    ekf.predict(motion)
    back = compose(pose(2.0, 1.0, 3.0), motion)
    seen = corners(
        (landmarks_world - back[:2])
        @ np.array([[math.cos(back[2]), -math.sin(back[2])], [math.sin(back[2]), math.cos(back[2])]]),
        orientations=0.3 - 0.4,
    )
    assert associate(seen, ekf, table, GATES).landmarks.tolist() == [0, 1]


def test_a_matched_corner_is_never_new_whatever_the_gates():
    gates = Gates(GATES.match, 0.0, 0.0, GATES.opening, GATES.orientation)
    assert outcome(corners([[3.0, 1.01]]), corners([[3.0, 1.0]]), gates) == ({0: 0}, [])
