"""Maps traced to walls: how near to what was drawn, and what the YAML says of them."""

import math

import numpy as np
import pytest
import shapely
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from features.se2 import pose, rotation, transform
from sim import Robot, WorldError, drive_through, find_site, findings, random_room
from sim.worlds.formats.grid_map import MapFile, _walls
from sim.worlds.formats.grid_outlines import trace_outlines
from sim.worlds.formats.world_file import read_site


def solid_of(walls):
    """Shape that polygons enclose: the largest without the others."""
    outline, *inner = sorted(
        shapely.get_parts(shapely.polygonize(shapely.linestrings(walls.reshape(-1, 2, 2)))), key=lambda p: -p.area
    )
    return shapely.difference(shapely.Polygon(outline.exterior), shapely.union_all(inner))


def drawn(shape, size):
    """Cells, shape (size, size), whose centre is in a shape [cells]."""
    x, y = np.meshgrid(np.arange(size) + 0.5, np.arange(size) + 0.5)
    return shapely.contains_xy(shape, x, y)


def boundary(rings):
    return shapely.union_all([shapely.LinearRing(ring) for ring in rings])


def test_what_lies_along_the_cells_is_exact():
    occupied = np.zeros((40, 50), dtype=bool)
    occupied[5:30, 10:45] = True
    occupied[10:20, 15:18] = False
    outer, hole = trace_outlines(occupied)
    assert {tuple(point) for point in np.round(outer, 9)} == {(10, 5), (45, 5), (45, 30), (10, 30)}
    assert {tuple(point) for point in np.round(hole, 9)} == {(15, 10), (18, 10), (18, 20), (15, 20)}


@pytest.mark.slow
@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.floats(-math.pi, math.pi), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_a_room_at_any_angle_is_traced_to_about_half_a_cell(seed, turn, dx, dy):
    """Cells of 5 cm.

    Along a wall a grid shows the line to half a cell; where it bends sharply or closely, the cells that would tell are
    missing, so that a vertex may be off by one and a half.
    """
    walls = random_room(seed).walls
    points = walls.reshape(-1, 2) @ rotation(turn).T / 0.05
    points += (dx, dy) - points.min(axis=0) + 3.0
    truth = solid_of(points)
    rings = trace_outlines(drawn(truth, int(points.max()) + 4))
    edge, traced = truth.boundary, boundary(rings)
    assert shapely.hausdorff_distance(traced, edge, densify=0.002) < 1.5
    middles = np.vstack([(ring + np.roll(ring, -1, axis=0)) / 2.0 for ring in rings])
    off = shapely.distance(shapely.points(middles), edge)
    assert np.mean(off) < 0.3
    assert len(middles) < 2 * len(walls)


@pytest.mark.parametrize("turn", np.radians([0.0, 3.0, 17.0, 30.0, 45.0, 80.0]))
def test_a_long_oblique_wall_stays_one_wall(turn):
    """A box of 200 by 60 cells has four walls at any angle, each within a third of a cell of the true one."""
    corners = np.array([(-100.0, -30.0), (100.0, -30.0), (100.0, 30.0), (-100.0, 30.0)]) @ rotation(turn).T + 115.0
    (ring,) = trace_outlines(drawn(shapely.Polygon(corners), 230))
    assert len(ring) == 4
    middles = (ring + np.roll(ring, -1, axis=0)) / 2.0
    off = shapely.distance(shapely.points(middles), shapely.LinearRing(corners))
    assert off.max() < (0.5 + 1e-9 if turn == 0.0 else 1.0 / 3.0)


@pytest.mark.parametrize("turn", np.radians([0.0, 10.0, 45.0, 63.0]))
def test_a_wall_of_one_cell_is_kept(turn):
    """As mapping programs draw it; what is traced is thinner than two cells and as long as the wall."""
    occupied = np.zeros((120, 120), dtype=bool)
    along = 60.5 + np.outer(np.linspace(-40.0, 40.0, 400), (math.cos(turn), math.sin(turn)))
    occupied[along[:, 1].astype(int), along[:, 0].astype(int)] = True
    rings = trace_outlines(occupied)
    middle = shapely.LineString(along[[0, -1]])
    assert shapely.hausdorff_distance(boundary(rings), middle, densify=0.01) < 1.5
    assert findings(np.vstack([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])) == []


def test_single_cells_are_kept_each_on_its_own():
    occupied = np.zeros((9, 9), dtype=bool)
    occupied[2, 2] = occupied[6, 5] = True
    rings = trace_outlines(occupied)
    assert sorted(tuple(np.round(ring.mean(axis=0), 6)) for ring in rings) == [(2.5, 2.5), (5.5, 6.5)]
    assert all(len(ring) >= 3 for ring in rings)


@pytest.mark.slow
@settings(derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.95))
@example(399, 0.875)
def test_any_grid_gives_outlines_of_walls_with_length(seed, density):
    occupied = np.random.default_rng(seed).random((12, 15)) < density
    rings = trace_outlines(occupied)
    assert all(len(ring) >= 3 for ring in rings)
    assert all((np.hypot(*(np.roll(ring, -1, axis=0) - ring).T) > 1e-6).all() for ring in rings)
    centres = np.argwhere(occupied)[:, ::-1] + 0.5
    if len(centres):
        # No cell is lost: each has a wall within three cells or is inside an outline.
        inside = shapely.union_all([shapely.Polygon(ring).buffer(2.0) for ring in rings])
        assert shapely.contains_xy(inside, *centres.T).all()


@pytest.fixture
def write_map(tmp_path):
    """Write a map of 30 by 20 cells with a block of 10 by 6 from column 4 and row 3 from below."""

    def write(block=0, ground=254, **keys):
        cells = np.full((20, 30), ground, dtype=np.uint8)
        cells[11:17, 4:14] = block
        Image.fromarray(cells).save(tmp_path / "map.pgm")
        content = {"image": "map.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "occupied_thresh": 0.65} | keys
        path = tmp_path / "map.yaml"
        path.write_text(yaml.safe_dump({key: value for key, value in content.items() if value is not None}))
        return path

    return write


BLOCK = {(0.4, 0.3), (1.4, 0.3), (1.4, 0.9), (0.4, 0.9)}


def vertices(site):
    return {tuple(point) for point in np.round(site.walls[:, :2], 6).tolist()}


def test_rows_go_down_and_y_goes_up(write_map):
    site = read_site(write_map())
    assert vertices(site) == BLOCK
    assert site.name == "map"


@settings(derandomize=True, deadline=None)
@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))
def test_the_origin_moves_and_turns_the_map(x, y, yaw):
    """Rounded to a micrometre."""
    content = MapFile(image="map.pgm", resolution=0.1, origin=(x, y, yaw))
    rings = [np.array([(4.0, 3.0), (14.0, 3.0), (14.0, 9.0)])]
    expected = transform(pose(x, y, yaw), 0.1 * rings[0])
    np.testing.assert_allclose(_walls(rings, content)[:, :2], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("keys", "occupied"),
    [
        ({"block": 0}, True),
        ({"block": 88}, True),  # (255 - 88) / 255 = 0.655
        ({"block": 90}, False),  # 0.647
        ({"block": 205}, False),  # unknown
        ({"block": 90, "occupied_thresh": 0.6}, True),
        ({"block": 254, "ground": 0, "negate": 1}, True),
        ({"block": 90, "ground": 0, "negate": 1, "occupied_thresh": 0.35}, True),
        ({"block": 0, "mode": "scale", "occupied_thresh": None}, True),
    ],
)
def test_a_cell_is_occupied_above_the_threshold(keys, occupied, write_map):
    path = write_map(**keys)
    if occupied:
        assert vertices(read_site(path)) == BLOCK
    else:
        with pytest.raises(WorldError, match=r"no cell of map\.pgm is occupied"):
            read_site(path)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"resolution": None}, "resolution: Field required"),
        ({"resolution": 0}, "resolution: Input should be greater than 0"),
        ({"origin": [0, 0]}, "origin"),
        ({"origin": [0, 0, float("nan")]}, "origin.2: Input should be a finite number"),
        ({"image": "other.pgm"}, r"no image .*other\.pgm"),
        ({"image": "map.yaml"}, "cannot be read as an image"),
        ({"mode": "raw"}, "mode: Input should be 'trinary' or 'scale'"),
        ({"occupied_thresh": 65}, "occupied_thresh: Input should be less than or equal to 1"),
    ],
)
def test_a_map_that_is_wrong_is_one_line(keys, message, write_map):
    with pytest.raises(WorldError, match=message) as caught:
        read_site(write_map(**keys))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["", "a: [", "- 1", "\x00"])
def test_a_yaml_that_is_none_is_one_line(content, tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text(content)
    with pytest.raises(WorldError) as caught:
        read_site(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_truncated_image_is_one_line(write_map):
    path = write_map()
    image = path.with_name("map.pgm")
    image.write_bytes(image.read_bytes()[:100])
    with pytest.raises(WorldError, match="cannot be read as an image"):
        read_site(path)


def test_the_apartment_as_a_map_is_the_apartment_to_a_cell(plans):
    """Cells of 5 cm, walls between rooms of 12 cm; the robot gets through its doors."""
    apartment, site = find_site("apartment"), read_site(plans / "apartment-map.yaml")
    assert findings(site.walls) == []
    walls = shapely.multilinestrings(list(site.walls.reshape(-1, 2, 2)))
    points = shapely.points(apartment.walls.reshape(-1, 2))
    assert shapely.distance(points, walls).max() < 0.05
    drive_through(site.world(), apartment.waypoints, Robot(), 10.0)
