"""The index of places: a place is found from any pose by four corners, its mirror image and other places are not."""

import math

import numpy as np
from constellations import mirrored, scattered, seen_again
from hypothesis import given
from hypothesis import strategies as st

from features.se2 import between, pose
from features.signature import Kind, Signatures
from slam.loop.constellation import Constellation
from slam.loop.geometric_hashing import GeometricHash
from slam.loop.rules import PlaceRules

SEEDS = st.integers(0, 2**32 - 1)
POSES = st.builds(pose, st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))


def anywhere(places, poses):
    return np.ones(len(places), np.bool_)


@given(SEEDS, POSES, st.integers(0, 4))
def test_a_place_is_found_from_any_pose(seed, where, place):
    """Six of eight corners are seen again; errors of 0.05 m at an arm of metres are some degrees at most."""
    rng = np.random.default_rng(seed)
    places = [scattered(rng, 8) for _ in range(5)]
    index = GeometricHash()
    for each in places:
        index.add(each)
    here = seen_again(places[place], where, rng, rng.permutation(8)[:6])
    best = index.propose(here, anywhere)[0]
    assert (best.place, best.count) == (place, 6)
    middle = here.positions.mean(axis=0)
    error = between(where, best.pose_place_robot)
    c, s = math.cos(error[2]), math.sin(error[2])
    assert np.hypot(*(error[:2] + np.array([[c, -s], [s, c]]) @ middle - middle)) < 0.15
    assert abs(error[2]) < 0.1


@given(SEEDS, POSES)
def test_a_place_is_proposed_with_as_many_corners_as_are_asked_for_and_not_with_one_less(seed, where):
    rng = np.random.default_rng(seed)
    place = scattered(rng, 8)
    here = seen_again(place, where, rng, rng.permutation(8)[:6])
    for least, counts in ((6, [6]), (7, [])):
        index = GeometricHash(PlaceRules(corners=least))
        index.add(place)
        assert [each.count for each in index.propose(here, anywhere)] == counts


@given(SEEDS, POSES)
def test_neither_a_mirror_image_nor_another_place_is_taken_for_a_place(seed, where):
    rng = np.random.default_rng(seed)
    place = scattered(rng, 8)
    index = GeometricHash(PlaceRules(corners=5))
    index.add(place)
    for other in (mirrored(place), scattered(rng, 8)):
        # Five of eight corners by chance: never, among those that are nowhere alike but in their kinds.
        assert index.propose(seen_again(other, where, rng), anywhere) == []


@given(SEEDS, POSES)
def test_of_two_places_that_are_copies_both_are_proposed(seed, where):
    rng = np.random.default_rng(seed)
    place = scattered(rng, 6)
    index = GeometricHash(PlaceRules(corners=5))
    for copy in (place, scattered(rng, 6), place):
        index.add(copy)
    assert sorted(p.place for p in index.propose(seen_again(place, where, rng), anywhere)) == [0, 2]


@given(SEEDS)
def test_a_place_where_the_robot_cannot_be_is_not_proposed(seed):
    rng = np.random.default_rng(seed)
    place = scattered(rng, 6)
    index = GeometricHash(PlaceRules(corners=5))
    index.add(place)
    index.add(place)
    here = seen_again(place, pose(3.0, 1.0, 2.0), rng)

    def second_only(places, poses):
        assert poses.shape == (len(places), 3)
        return places == 1

    assert [each.place for each in index.propose(here, second_only)] == [1]


@given(SEEDS)
def test_a_place_is_found_where_some_of_it_are_points(seed):
    """Points have no angles; the pairs they make are told from pairs of corners by their kind alone."""
    rng = np.random.default_rng(seed)
    corners = scattered(rng, 10)
    point = np.arange(10) < 4
    signatures = corners.signatures
    mixed = Constellation(
        corners.positions,
        Signatures(
            np.where(point, Kind.POINT, signatures.kinds),
            np.where(point, np.nan, signatures.opening_angles),
            np.where(point, np.nan, signatures.orientations),
        ),
    )
    index = GeometricHash()
    index.add(mixed)
    where = pose(3.0, -2.0, 1.0)
    best = index.propose(seen_again(mixed, where, rng), anywhere)[0]
    assert best.count == 10
    assert abs(between(where, best.pose_place_robot)[2]) < 0.1


def test_places_without_corners_are_no_places():
    rng = np.random.default_rng(0)
    index = GeometricHash(PlaceRules(corners=3))
    assert index.propose(scattered(rng, 6), anywhere) == []
    index.add(scattered(rng, 0))
    index.add(scattered(rng, 1))
    assert len(index) == 2
    assert index.propose(scattered(rng, 6), anywhere) == []
    assert index.propose(scattered(rng, 0), anywhere) == []
