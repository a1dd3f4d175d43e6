"""Drawings: units, lines, polylines and blocks; what is left out is said."""

import logging
import math
import sys

import ezdxf.filemanagement
import numpy as np
import pytest
import shapely
from ezdxf.enums import InsertUnits

from features.se2 import rotation
from sim import Robot, WorldError, drive_through, find_site, findings
from sim.worlds.formats.world_file import read_site


@pytest.fixture
def drawing():
    return ezdxf.filemanagement.new(units=InsertUnits.Meters)


@pytest.fixture
def read(tmp_path):
    def read_drawing(drawing):
        path = tmp_path / "plan.dxf"
        drawing.saveas(path)
        return read_site(path)

    return read_drawing


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        (InsertUnits.Meters, 1.0),
        (InsertUnits.Millimeters, 1e-3),
        (InsertUnits.Centimeters, 1e-2),
        (InsertUnits.Inches, 0.0254),
        (InsertUnits.Feet, 0.3048),
    ],
)
def test_lengths_are_in_the_unit_of_the_drawing(unit, metres, drawing, read):
    drawing.units = unit
    drawing.modelspace().add_line((1000.0, 0.0), (1000.0, 2000.0))
    np.testing.assert_allclose(
        read(drawing).walls, [[1000.0 * metres, 0.0, 1000.0 * metres, 2000.0 * metres]], atol=1e-6
    )


def test_lines_and_polylines_open_and_closed(drawing, read):
    space = drawing.modelspace()
    space.add_line((0, 0, 2.5), (1, 0, 2.5))
    space.add_lwpolyline([(0, 1), (1, 1), (1, 2)])
    space.add_lwpolyline([(0, 3), (1, 3), (1, 4)], close=True)
    space.add_polyline2d([(0, 5), (1, 5)])
    space.add_polyline3d([(0, 6, 1), (1, 6, 2), (2, 6, 1)])
    expected = [
        *[(0, 0, 1, 0), (0, 1, 1, 1), (1, 1, 1, 2), (0, 3, 1, 3), (1, 3, 1, 4), (1, 4, 0, 3), (0, 5, 1, 5)],
        *[(0, 6, 1, 6), (1, 6, 2, 6)],
    ]
    np.testing.assert_allclose(read(drawing).walls, expected, atol=1e-9)


def test_an_arc_of_a_polyline_becomes_walls_on_it(drawing, read):
    """A half circle of a metre, within 5 mm; ezdxf draws it by cubic curves, whose points are off it by 0.3 mm."""
    drawing.modelspace().add_lwpolyline([(-1, 0, 1.0), (1, 0, 0.0)], format="xyb")
    walls = read(drawing).walls
    assert len(walls) >= 8
    radii = np.hypot(*((walls[:, :2] + walls[:, 2:]) / 2.0).T)
    assert (radii > 0.995).all()
    np.testing.assert_allclose(np.hypot(*walls[:, :2].T), 1.0, atol=3e-4)
    np.testing.assert_array_equal(walls[1:, :2], walls[:-1, 2:])


def test_blocks_are_moved_turned_scaled_nested_and_repeated(drawing, read):
    inner = drawing.blocks.new("LEG")
    inner.add_line((0, 0), (1, 0))
    outer = drawing.blocks.new("TABLE")
    outer.add_blockref("LEG", (2, 0), dxfattribs={"rotation": 90})
    drawing.modelspace().add_blockref("TABLE", (10, 5), dxfattribs={"rotation": 30, "xscale": 2, "yscale": 2})
    turn = rotation(math.radians(30))
    expected = np.concatenate([(10, 5) + turn @ (4, 0), (10, 5) + turn @ (4, 2)])
    np.testing.assert_allclose(read(drawing).walls, [expected], atol=1e-6)

    drawing.modelspace().add_blockref(
        "LEG", (0, 0), dxfattribs={"row_count": 2, "column_count": 3, "row_spacing": 4, "column_spacing": 5}
    )
    starts = {tuple(np.round(wall[:2], 6)) for wall in read(drawing).walls[1:]}
    assert starts == {(x, y) for x in (0.0, 5.0, 10.0) for y in (0.0, 4.0)}


def test_lines_that_meet_but_for_rounding_meet(drawing, read):
    space = drawing.modelspace()
    corners = [(0.0, 0.0), (0.1 + 0.2, 0.0), (0.3, 1.0 / 3.0)]
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        space.add_line((start[0] + 1e-9, start[1]), end)
    site = read(drawing)
    assert findings(site.walls) == []
    assert len(site.world().corners) == 3


def test_hidden_layers_do_not_count_and_other_entities_are_said(drawing, read, caplog):
    space = drawing.modelspace()
    space.add_line((0, 0), (1, 0))
    drawing.layers.add("OFF").off()
    drawing.layers.add("FROZEN").freeze()
    for layer in ("OFF", "FROZEN", "off"):
        space.add_line((5, 5), (6, 6), dxfattribs={"layer": layer})
    space.add_text("room")
    space.add_circle((0, 0), 1)
    space.add_arc((0, 0), 1, 0, 90)
    drawing.layout("Layout1").add_line((7, 7), (8, 8))
    with caplog.at_level(logging.WARNING):
        assert len(read(drawing).walls) == 1
    assert "1 ARC, 1 CIRCLE, 1 TEXT" in caplog.text


def test_what_cannot_be_read_is_one_line(drawing, read, tmp_path):
    with pytest.raises(WorldError, match="no line and no polyline"):
        read(drawing)
    drawing.modelspace().add_line((0, 0), (1, 0))
    drawing.units = InsertUnits.Unitless
    with pytest.raises(WorldError, match=r"unit \(\$INSUNITS\) is 0: expected one of length"):
        read(drawing)
    drawing.units = InsertUnits.Meters
    read(drawing)
    whole = (tmp_path / "plan.dxf").read_bytes()
    for content in (
        whole[:500],
        whole[: len(whole) // 2],
        b"",
        b"not a drawing",
        b"  0\nSECTION\n  2\nENTITIES\n  0\nLINE\n 10\nx\n",
        bytes(range(256)),
    ):
        path = tmp_path / "broken.dxf"
        path.write_bytes(content)
        with pytest.raises(WorldError) as caught:
            read_site(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_without_ezdxf_the_message_says_how_to_get_it(drawing, read, monkeypatch):
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    monkeypatch.delitem(sys.modules, "sim.worlds.formats.dxf_world", raising=False)
    drawing.modelspace().add_line((0, 0), (1, 0))
    with pytest.raises(WorldError, match=r"pip install ezdxf"):
        read(drawing)


def test_the_plan_of_the_apartment_is_the_apartment(plans):
    """Drawn in millimetres, its furniture as blocks, and the same to the rounding of a micrometre."""
    apartment, site = find_site("apartment"), read_site(plans / "apartment-plan.dxf")
    assert findings(site.walls) == []
    assert len(site.walls) == len(apartment.walls)
    drawn, truth = (shapely.multilinestrings(list(s.walls.reshape(-1, 2, 2))) for s in (site, apartment))
    assert shapely.hausdorff_distance(drawn, truth) < 2e-6
    drive_through(site.world(), apartment.waypoints, Robot(), 10.0)
