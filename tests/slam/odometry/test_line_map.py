"""Walls of lines and points on them: faces, frames, and how far an error of a line moves its wall at each place."""

import dataclasses
import math

import numpy as np
import pytest
from registration_scenes import CONFIG, LINE_DISTANCE, SENSOR

from features.extraction import extract
from features.feature import LineForm
from features.se2 import pose, rotation, transform
from features.sensor import Mounting
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from slam.odometry.line_map import (
    CENTER,
    LENGTH,
    NORMAL_X,
    NORMAL_Y,
    VAR_ANGLE,
    VAR_OFFSET,
    WALL_FIELDS,
    WALL_X,
    WALL_Y,
    LineMap,
    walls_of_lines,
)
from slam.odometry.scan_points import scan_points

HERE = pose(2.2, 1.7, 0.6)
MOUNTINGS = pytest.mark.parametrize(
    "mounting", [Mounting(0.2, -0.1, 2.0), Mounting(0.1, 0.1, -0.7, upside_down=True)], ids=["upright", "upside down"]
)


def room_lines(mounting, fit, rng):
    """A scan of the room and its lines, with any covariances of their parameters."""
    scan = Lidar.of_preset("rplidar-s1", mounting).scan(room(), HERE, 0.0, rng)
    sensor = dataclasses.replace(SENSOR, mounting=mounting)
    lines = extract(scan, sensor, CONFIG.extraction.model_copy(update={"fit": fit})).lines
    roots = rng.normal(0.0, 0.01, (len(lines), 2, 2))
    lines.covs[:] = roots @ roots.transpose(0, 2, 1)
    return scan, sensor, lines


def points_and_faces(walls):
    return walls[:, [WALL_X, WALL_Y]], walls[:, [NORMAL_X, NORMAL_Y]]


@MOUNTINGS
def test_a_wall_lies_between_the_ends_of_its_line_and_faces_the_sensor(mounting):
    _, sensor, lines = room_lines(mounting, "effective-variance", np.random.default_rng(0))
    walls = walls_of_lines(lines, sensor.mounting)
    middles, normals = points_and_faces(walls)
    ends = np.array([mounting.points_to_robot(each) for each in lines.ends])
    np.testing.assert_allclose(middles, ends.mean(axis=1), atol=1e-12)
    along = ends[:, 1] - ends[:, 0]
    np.testing.assert_allclose(walls[:, LENGTH], np.hypot(*along.T), rtol=1e-12)
    np.testing.assert_allclose(np.hypot(*normals.T), 1.0, rtol=1e-12)
    np.testing.assert_allclose((normals * along).sum(axis=1), 0.0, atol=1e-9)
    assert ((normals * (middles - [mounting.x, mounting.y])).sum(axis=1) < 0.0).all()


@MOUNTINGS
@pytest.mark.parametrize("fit", ["effective-variance", "total-least-squares"])
def test_a_wall_errs_at_each_place_as_its_line_does(fit, mounting):
    """Against the offset of a line whose parameters are moved by a little, at places along and beyond the wall."""
    _, sensor, lines = room_lines(mounting, fit, np.random.default_rng(1))
    walls = walls_of_lines(lines, sensor.mounting)
    middles, normals = points_and_faces(walls)
    assert {LineForm.POLAR} == set(lines.forms) or {LineForm.X_ON_Y, LineForm.Y_ON_X} == set(lines.forms)
    for place in (-1.5, 0.0, 0.7):
        # Counter-clockwise as the sensor sees it is along the normal turned by a quarter to the right.
        points = middles + place * np.stack([normals[:, 1], -normals[:, 0]], axis=-1)
        for line, wall, point in zip(lines, walls, mounting.points_to_sensor(points), strict=True):
            step = 1e-6
            jacobian = np.array(
                [(offset(line, point, step * each) - offset(line, point, -step * each)) / step for each in np.eye(2)]
            )
            variance = 0.25 * jacobian @ line.cov @ jacobian
            expected = wall[VAR_OFFSET] + wall[VAR_ANGLE] * (place - wall[CENTER]) ** 2
            assert variance == pytest.approx(expected, rel=1e-4)


def offset(line, point, change):
    """Distance, with a sign, of a point from a line whose parameters are changed."""
    first, second = line.params + change
    x, y = point
    if line.form == LineForm.POLAR:
        return x * math.cos(first) + y * math.sin(first) - second
    u, v = (y, x) if line.form == LineForm.X_ON_Y else (x, y)
    return (v - second - first * (u - line.center)) / math.hypot(1.0, first)


def test_a_line_map_holds_the_walls_of_its_latest_key_frames_in_its_own_frame():
    rng = np.random.default_rng(2)
    _, sensor, lines = room_lines(Mounting(), "effective-variance", rng)
    walls = walls_of_lines(lines, sensor.mounting)
    middles, normals = points_and_faces(walls)
    places = [pose(*rng.uniform(-3.0, 3.0, 3)) for _ in range(3)]
    line_map = LineMap(2)
    for place in places:
        line_map.add(walls, place)
    found = line_map.walls.reshape(2, len(walls), WALL_FIELDS)
    for each, place in zip(found, places[1:], strict=True):
        np.testing.assert_allclose(each[:, [WALL_X, WALL_Y]], transform(place, middles), atol=1e-12)
        np.testing.assert_allclose(each[:, [NORMAL_X, NORMAL_Y]], normals @ rotation(place[2]).T, atol=1e-12)
        np.testing.assert_array_equal(each[:, LENGTH:], walls[:, LENGTH:])


@MOUNTINGS
def test_a_point_is_of_the_line_that_its_beam_meets_nearby(mounting):
    """Also where a line crosses the end of the scan, and with the normal of that line."""
    scan, sensor, lines = room_lines(mounting, "effective-variance", np.random.default_rng(3))
    walls = walls_of_lines(lines, sensor.mounting)
    middles, normals = points_and_faces(walls)
    found = scan_points(scan, walls, sensor, LINE_DISTANCE)
    origin = np.array([mounting.x, mounting.y])
    arms, halves = middles - origin, 0.5 * walls[:, [LENGTH]] * np.stack([normals[:, 1], -normals[:, 0]], axis=-1)
    beams = found.points - origin
    expected = np.full(len(found), -1)
    for k in range(len(walls)):
        met = (np.linalg.det(np.stack(np.broadcast_arrays(arms[k] - halves[k], beams), axis=-2)) >= 0.0) & (
            np.linalg.det(np.stack(np.broadcast_arrays(beams, arms[k] + halves[k]), axis=-2)) >= 0.0
        )
        expected[met & (np.abs((beams - arms[k]) @ normals[k]) <= LINE_DISTANCE)] = k
    np.testing.assert_array_equal(found.lines, expected)
    assert {0, len(walls) - 1} <= set(found.lines.tolist())
    on_line = found.lines >= 0
    np.testing.assert_array_equal(found.normals[on_line], normals[found.lines[on_line]])


@MOUNTINGS
def test_the_surface_at_a_point_of_no_line_faces_the_sensor(mounting):
    scan, sensor, _ = room_lines(mounting, "effective-variance", np.random.default_rng(4))
    found = scan_points(scan, np.empty((0, WALL_FIELDS)), sensor, LINE_DISTANCE)
    told = np.isfinite(found.normals).all(axis=1)
    assert told.mean() > 0.5
    np.testing.assert_allclose(np.hypot(*found.normals[told].T), 1.0, rtol=1e-12)
    beams = found.points[told] - [mounting.x, mounting.y]
    assert ((beams * found.normals[told]).sum(axis=1) <= 0.0).all()
