"""The stand-ins for environments A and B of the paper: sizes, counts, and that the counts hang on no detail."""

import itertools

import numpy as np
import pytest
import shapely

from sim import (
    ENVIRONMENT_A_POSE,
    ENVIRONMENT_B_POSE,
    environment_a,
    environment_b,
    visible_corners,
    visible_sections,
)

A = (environment_a, ENVIRONMENT_A_POSE, 23, 36)
B = (environment_b, ENVIRONMENT_B_POSE, 15, 18)
BOTH = pytest.mark.parametrize(("make", "pose", "corners", "sections"), [A, B], ids=["a", "b"])


def sections_at(world, pose, corner):
    """Length [m] and beams of the visible section on either side of a corner."""
    sections = visible_sections(world, pose)
    direction = np.arctan2(*(world.corners[corner] - pose[:2])[::-1])
    last = int((direction - pose[2] + np.pi) // (2.0 * np.pi / 920)) % 920
    before = np.flatnonzero(sections.last_beams == last)
    after = np.flatnonzero(sections.first_beams == (last + 1) % 920)
    assert {*sections.wall_ids[before], *sections.wall_ids[after]} == set(world.corner_walls[corner])
    return sections.lengths[[*before, *after]], sections.beam_counts[[*before, *after]]


@BOTH
def test_counts_are_those_of_the_paper(make, pose, corners, sections):
    world = make()
    assert visible_sections(world, pose).shown(6, 0.3).sum() == sections
    seen = visible_corners(world, pose, 6, 0.3)
    assert len(seen) == corners
    opening_deg = np.degrees(world.opening_angles[seen])
    assert ((opening_deg > 30.0) & (opening_deg <= 150.0)).all()


@BOTH
def test_counts_hang_on_no_detail(make, pose, corners, sections):
    """For a sensor 2 cm beside or turned by 2 deg, and other numbers of beams: all that shows is clearly above limits.

    There is no section below them, so that the count would be the same for any limit up to 8 beams and 0.4 m.
    """
    world = make()
    expected = visible_corners(world, pose, 6, 0.3)
    for dx, dy, turn in itertools.product((-0.02, 0.0, 0.02), (-0.02, 0.0, 0.02), (-0.035, 0.0, 0.035)):
        for beams in range(900, 941):
            moved = pose + np.array([dx, dy, turn])
            shown = visible_sections(world, moved, beams)
            assert len(shown) == sections
            assert shown.shown(8, 0.4).all()
            np.testing.assert_array_equal(visible_corners(world, moved, 8, 0.4, beams), expected)
    assert len(expected) == corners


@pytest.mark.parametrize(("make", "size"), [(environment_a, (9.0, 8.0)), (environment_b, (3.5, 6.0))])
def test_sizes_are_those_of_the_paper(make, size):
    points = make().walls.reshape(-1, 2)
    np.testing.assert_array_equal(points.min(axis=0), [0.0, 0.0])
    np.testing.assert_array_equal(points.max(axis=0), size)


@pytest.mark.parametrize(("make", "pose", "things"), [(*A[:2], 4), (*B[:2], 1)])
def test_outline_holds_the_things_that_stand_free_and_the_sensor(make, pose, things):
    lines = [shapely.LineString(wall.reshape(2, 2)) for wall in make().walls]
    outline, *pillars = sorted(shapely.get_parts(shapely.polygonize(lines)), key=lambda part: -part.area)
    assert len(pillars) == things
    assert outline.is_valid
    assert outline.contains(shapely.Point(pose[:2]))
    assert all(shapely.Polygon(outline.exterior).contains(pillar) for pillar in pillars)
    # Half a metre beside the sensor, so that a robot could carry it there.
    assert shapely.distance(shapely.MultiLineString(lines), shapely.Point(pose[:2])) > 0.5


def test_corner_20_of_a_opens_by_130_deg_between_long_walls():
    """A metre and 50 beams on each wall at least, as the 100 measurements of Fig. 4 ask for."""
    world, pose = environment_a(), ENVIRONMENT_A_POSE
    corner = visible_corners(world, pose, 6, 0.3)[19]
    # Coordinates are given to the centimetre: 5 mm in 1.8 m are 0.16 deg.
    assert np.degrees(world.opening_angles[corner]) == pytest.approx(130.0, abs=0.16)
    lengths, beam_counts = sections_at(world, pose, corner)
    assert (lengths >= 1.0).all()
    assert (beam_counts >= 50).all()


def test_all_other_corners_of_a_but_the_far_end_of_the_chamfer_are_square():
    world = environment_a()
    opening_deg = np.degrees(world.opening_angles[visible_corners(world, ENVIRONMENT_A_POSE, 6, 0.3)])
    np.testing.assert_allclose(np.sort(opening_deg)[:-2], 90.0, atol=1e-9)


def test_corner_4_of_b_is_square_between_long_walls():
    world, pose = environment_b(), ENVIRONMENT_B_POSE
    corner = visible_corners(world, pose, 6, 0.3)[3]
    assert np.degrees(world.opening_angles[corner]) == pytest.approx(90.0, abs=1e-9)
    lengths, beam_counts = sections_at(world, pose, corner)
    assert (lengths >= 1.5).all()
    assert (beam_counts >= 50).all()


@pytest.mark.parametrize("pose", [ENVIRONMENT_A_POSE, ENVIRONMENT_B_POSE])
def test_poses_cannot_be_changed_by_accident(pose):
    with pytest.raises(ValueError, match="read-only"):
        pose[0] = 0.0
