"""What is remembered of landmarks: means, frames, counts and where each one is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from observed_corners import corners

from features.se2 import wrap_angle
from slam.filter.landmark_table import ACTIVE, MERGED, LandmarkTable

angles = st.floats(-math.pi, math.pi)


def table_of(orientations, heading=0.0):
    table = LandmarkTable()
    k = len(orientations)
    seen = corners(np.zeros((k, 2)), orientations=np.array(orientations))
    table.add(seen, np.arange(k), heading)
    return table


def test_signatures_are_means_over_the_observations():
    table = LandmarkTable()
    first = corners([[1.0, 0.0]], openings=1.5, orientations=math.pi - 0.1)
    second = corners([[1.0, 0.0]], openings=1.7, orientations=-math.pi + 0.3)
    assert table.add(first, np.array([0]), 0.0).tolist() == [0]
    table.see(np.array([0]), second, np.array([0]), 0.0)
    assert table.observations.tolist() == [2]
    assert table.signatures().opening_angles == pytest.approx([1.6])
    assert wrap_angle(table.signatures().orientations - (-math.pi + 0.1)) == pytest.approx([0.0], abs=1e-9)


@given(st.lists(angles, min_size=1, max_size=4), angles)
def test_orientations_are_told_in_the_world(orientations, heading):
    table = table_of(orientations, heading)
    np.testing.assert_allclose(
        wrap_angle(table.signatures().orientations - np.array(orientations) - heading), 0.0, atol=1e-12
    )
    assert (table.key_frames == ACTIVE).all()
    assert np.isnan(table.positions).all()


@given(angles, angles, angles, angles, angles)
def test_at_rest_an_orientation_turns_with_its_key_frame(orientation, heading, key_heading, moved, key_heading_after):
    """Also where the frame of the state was turned between home and rest."""
    table = table_of([orientation, orientation], heading)
    before = table.signatures().orientations
    landmark = np.array([1])
    table.anchor(landmark, 7, key_heading, np.array([[1.0, 2.0]]), np.eye(2)[None])
    assert table.key_frames.tolist() == [ACTIVE, ACTIVE]
    table.rebase(landmark, moved)
    table.deactivate(landmark)
    assert table.key_frames.tolist() == [ACTIVE, 7]
    np.testing.assert_array_equal(table.positions[1], [1.0, 2.0])
    np.testing.assert_allclose(
        wrap_angle(table.signatures().orientations[1] + key_heading - before[1]), 0.0, atol=1e-12
    )
    table.activate(landmark, np.array([key_heading_after]))
    turned = wrap_angle(table.signatures().orientations - before)
    np.testing.assert_allclose(wrap_angle(turned - [0.0, key_heading_after - key_heading]), 0.0, atol=1e-12)
    assert table.key_frames.tolist() == [ACTIVE, ACTIVE]


def test_a_mean_goes_on_over_rest_and_wake():
    """Observations before the rest keep their weight."""
    table = table_of([0.2])
    table.see(np.array([0]), corners([[0.0, 0.0]], orientations=0.4), np.array([0]), 0.0)
    table.anchor(np.array([0]), 0, 1.0, np.zeros((1, 2)), np.eye(2)[None])
    table.deactivate(np.array([0]))
    table.activate(np.array([0]), np.array([2.0]))
    table.see(np.array([0]), corners([[0.0, 0.0]], orientations=0.3), np.array([0]), 1.0)
    assert table.signatures().orientations == pytest.approx([1.3], abs=1e-12)
    assert table.observations.tolist() == [3]


def test_merged_landmarks_count_together():
    table = table_of([0.1, 0.0, 0.5])
    table.see(np.array([2]), corners([[0.0, 0.0]], openings=1.2, orientations=0.3), np.array([0]), 0.0)
    table.misses[:] = [1, 2, 4]
    table.merge(0, 2)
    assert table.observations[0] == 3
    assert table.misses[0] == 5
    # The mean of three directions, weighted alike.
    assert table.signatures().orientations[0] == pytest.approx(0.3, abs=1e-12)
    assert table.signatures().opening_angles[0] == pytest.approx((math.pi + 1.2) / 3.0)
    assert table.key_frames.tolist() == [ACTIVE, ACTIVE, MERGED]
    assert len(table) == 3


@pytest.mark.parametrize("later", [0, 1])
def test_a_merged_landmark_lives_where_one_of_the_two_was_seen_last(later):
    table = table_of([0.0, 0.0])
    for landmark, key_frame in ((later, 9), (1 - later, 4)):
        place = np.full((1, 2), float(key_frame))
        table.anchor(np.array([landmark]), key_frame, 0.1 * key_frame, place, key_frame * np.eye(2)[None])
    table.merge(0, 1)
    assert (table.anchors[0], table.headings[0]) == (9, pytest.approx(0.9))
    assert table.positions[0].tolist() == [9.0, 9.0]
    assert table.covs[0].tolist() == [[9.0, 0.0], [0.0, 9.0]]


def test_a_woken_landmark_that_is_not_seen_goes_back_to_rest_as_it_was():
    table = table_of([0.4])
    table.anchor(np.array([0]), 3, 1.0, np.array([[1.0, 2.0]]), np.eye(2)[None])
    table.deactivate(np.array([0]))
    before = table.signatures().orientations
    table.activate(np.array([0]), np.array([1.5]))
    table.rebase(np.array([0]), 0.2)
    table.deactivate(np.array([0]))
    assert table.key_frames.tolist() == [3]
    assert table.signatures().orientations == pytest.approx(before, abs=1e-12)


@given(angles, angles, angles, angles, angles)
def test_in_the_world_an_orientation_goes_with_the_key_frame_that_saw_it_last(
    orientation, heading, key_heading, moved, key_heading_after
):
    """At rest or in the state alike; a landmark that no key frame has seen stays as it is."""
    table = table_of([orientation] * 3, heading)
    before = table.signatures().orientations
    table.anchor(np.array([1, 2]), 1, key_heading, np.zeros((2, 2)), np.tile(np.eye(2), (2, 1, 1)))
    table.rebase(np.array([1, 2]), moved)
    table.deactivate(np.array([2]))
    landmarks, headings = np.array([2, 0, 1]), np.array([0.5, key_heading_after])
    turned = table.signatures_world(landmarks, headings).orientations - before[landmarks]
    expected = np.array([key_heading_after - key_heading, 0.0, key_heading_after - key_heading])
    np.testing.assert_allclose(wrap_angle(turned - expected), 0.0, atol=1e-12)
