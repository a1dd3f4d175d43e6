"""Constellations: each corner once, whoever saw it from where; laid on one another they find where they belong."""

import math

import numpy as np
from constellations import SIGMA_POSITION, as_corners, scattered, seen_again
from hypothesis import given
from hypothesis import strategies as st

from features.se2 import between, compose, pose, wrap_angle
from features.signature import Kind
from slam.loop.constellation import collect_constellation, fit_constellation
from slam.loop.rules import PlaceRules

SEEDS = st.integers(0, 2**32 - 1)
POSES = st.builds(pose, st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))


def tolerant(distance):
    return PlaceRules(corner_tolerance=distance)


@given(SEEDS, st.lists(POSES, min_size=1, max_size=5))
def test_a_corner_seen_from_several_poses_is_one(seed, poses):
    corners = scattered(np.random.default_rng(seed), 6)
    gathered = collect_constellation(poses, [as_corners(corners, each) for each in poses])
    np.testing.assert_allclose(gathered.positions, corners.positions, atol=1e-9)
    found, expected = gathered.signatures, corners.signatures
    np.testing.assert_allclose(wrap_angle(found.orientations - expected.orientations), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.opening_angles, expected.opening_angles, atol=1e-9)
    assert (found.kinds == expected.kinds).all()


@given(SEEDS, st.sampled_from([0.0, 2.0, math.pi]), st.floats(0.01, 0.15))
def test_an_orientation_is_the_mean_of_its_sightings_over_the_cut_of_angles_too(seed, orientation, error):
    corners = scattered(np.random.default_rng(seed), 6)
    corners.signatures.orientations[:] = orientation
    sightings = [as_corners(corners, pose()) for _ in range(2)]
    for sighting, sign in zip(sightings, (1.0, -1.0), strict=True):
        sighting.records["orientation"] += sign * error
    found = collect_constellation([pose(), pose()], sightings).signatures
    np.testing.assert_allclose(wrap_angle(found.orientations - orientation), 0.0, atol=1e-9)


@given(SEEDS)
def test_corners_of_different_kinds_stay_apart_though_they_are_near(seed):
    corners = scattered(np.random.default_rng(seed), 5)
    other = as_corners(corners, pose())
    other.records["kind"] = np.where(other.convex, Kind.CONCAVE, Kind.CONVEX)
    assert len(collect_constellation([pose(), pose()], [as_corners(corners, pose()), other])) == 10


def test_nothing_seen_is_no_constellation():
    corners = as_corners(scattered(np.random.default_rng(0), 0), pose())
    assert len(collect_constellation([pose()], [corners])) == 0


@given(SEEDS, POSES, st.floats(-0.25, 0.25), st.floats(-0.02, 0.02))
def test_laid_near_where_it_belongs_a_constellation_finds_its_place(seed, where, off, turn):
    """Within 0.4 m of its place each corner finds itself, as none is nearer to another than 1.2 m.

    The position of eight corners is the mean of eight errors: six sigmas of it are the tolerance, for x and y each.
    """
    rng = np.random.default_rng(seed)
    there = scattered(rng, 8)
    here = seen_again(there, where, rng)
    # Turned about the middle of the corners, so that none of them leaves its tolerance.
    start = compose(pose(off, 0.0, turn), where)
    found, count = fit_constellation(here, there, start, tolerant(0.6))
    assert count == 8
    middle = here.positions.mean(axis=0)
    error = compose(found, pose(*middle))[:2] - compose(where, pose(*middle))[:2]
    assert np.abs(error).max() < 6.0 * SIGMA_POSITION / math.sqrt(8.0)
    assert abs(between(where, found)[2]) < 0.1


@given(SEEDS)
def test_no_corner_counts_twice(seed):
    rng = np.random.default_rng(seed)
    there = scattered(rng, 4)
    _, count = fit_constellation(
        collect_constellation([pose(), pose(0.35)], [as_corners(there, pose())] * 2), there, pose(), tolerant(0.5)
    )
    assert count <= 4


def test_a_constellation_of_one_corner_lies_nowhere():
    one = scattered(np.random.default_rng(1), 1)
    assert fit_constellation(one, one, pose(), tolerant(0.5))[1] == 0
