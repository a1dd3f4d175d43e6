"""Boxes of SDF: where nested poses put them, which the lidar sees, what they join to."""

import logging
import math
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from features.se2 import compose, pose, rotation
from sim import WorldError, findings
from sim.worlds.formats.world_file import read_site

NUMBERS = st.floats(-20.0, 20.0)
POSES = st.tuples(NUMBERS, NUMBERS, st.floats(-math.pi, math.pi))


def box(size="2 1 1", at="0 0 0 0 0 0"):
    return f"<collision name='c'><pose>{at}</pose><geometry><box><size>{size}</size></box></geometry></collision>"


def sdf(*shapes, model="0 0 0 0 0 0", link="0 0 0 0 0 0", extra=""):
    return (
        f"<sdf version='1.6'><model name='house'><pose>{model}</pose>"
        f"<link name='wall'><pose>{link}</pose>{''.join(shapes)}</link>{extra}</model></sdf>"
    )


@pytest.fixture
def read(tmp_path):
    def read_text(text):
        path = tmp_path / "world.sdf"
        path.write_text(text)
        return read_site(path)

    return read_text


def vertices(site):
    return {tuple(point) for point in np.round(site.walls[:, :2], 6).tolist()}


def test_a_box_is_four_walls_around_its_centre(read):
    site = read(sdf(box()))
    assert vertices(site) == {(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)}
    assert len(site.walls) == 4
    assert site.name == "house"


@settings(derandomize=True, deadline=None)
@given(model=POSES, link=POSES, shape=POSES)
def test_poses_nest(model, link, shape, tmp_path_factory):
    """Model, link and collision: a chain of SE(2); corners are rounded to the millimetre."""
    path = tmp_path_factory.mktemp("sdf") / "world.sdf"
    texts = [f"{x!r} {y!r} 0 0 0 {yaw!r}" for x, y, yaw in (model, link, shape)]
    path.write_text(sdf(box(at=texts[2]), model=texts[0], link=texts[1]))
    x, y, yaw = compose(compose(pose(*model), pose(*link)), pose(*shape))
    expected = np.array([(-1.0, -0.5), (1.0, -0.5), (1.0, 0.5), (-1.0, 0.5)]) @ rotation(yaw).T + (x, y)
    found = read_site(path).walls[:, :2]
    assert len(found) == 4
    distances = np.hypot(*(found[:, None] - expected).transpose(2, 0, 1))
    assert distances.min(axis=0).max() < 0.75e-3  # half a millimetre in x and in y


@pytest.mark.parametrize(
    ("z", "tall", "seen"), [(0.5, 1.0, True), (2.25, 0.5, False), (0.05, 0.2, False), (0.2, 0.01, True)]
)
def test_a_box_counts_where_it_cuts_the_scan_plane(z, tall, seen, read):
    """The plane is 0.2 m above the ground: a lintel and a threshold are not seen."""
    text = sdf(box(at="5 5 0.5 0 0 0"), box(size=f"1 1 {tall}", at=f"0 0 {z} 0 0 0"))
    assert len(read(text).walls) == (8 if seen else 4)


def test_boxes_that_overlap_or_touch_become_one_outline(read):
    """An L of two boxes that share a corner square has six walls; two halves of a wall have four."""
    ell = read(sdf(box("4 0.2 1"), box("0.2 3 1", "-1.9 1.4 0 0 0 0")))
    assert len(ell.walls) == 6
    assert len(ell.world().corners) == 6
    halves = read(sdf(box("2 0.2 1"), box("2 0.2 1", "2 0.0003 0 0 0 0")))
    assert len(halves.walls) == 4
    assert findings(ell.walls) == findings(halves.walls) == []


def test_boxes_in_a_ring_enclose_a_room(read):
    ring = read(
        sdf(
            box("4 0.2 1", "0 2 0 0 0 0"),
            box("4 0.2 1", "0 -2 0 0 0 0"),
            box("0.2 4.2 1", "2 0 0 0 0 0"),
            box("0.2 4.2 1", "-2 0 0 0 0 0"),
        )
    )
    assert len(ring.walls) == 8
    assert {(-1.9, -1.9), (1.9, 1.9), (-2.1, -2.1), (2.1, 2.1)} <= vertices(ring)


def test_degrees_are_understood(read):
    text = sdf(box()).replace(
        "<collision name='c'><pose>0 0 0 0 0 0", "<collision name='c'><pose degrees='true'>0 0 0 0 0 90"
    )
    assert vertices(read(text)) == {(0.5, -1.0), (0.5, 1.0), (-0.5, 1.0), (-0.5, -1.0)}


def test_what_is_no_upright_box_is_left_out_and_said(read, caplog):
    mesh = "<collision name='m'><geometry><mesh><uri>x.dae</uri></mesh></geometry></collision>"
    tilted = box(at="0 0 0 0.3 0 0")
    nested = (
        "<model name='inner'><link><visual><geometry><box><size>9 9 9</size></box></geometry></visual></link></model>"
    )
    with caplog.at_level(logging.WARNING):
        site = read(sdf(box(), mesh, mesh, tilted, extra="<include><uri>model://sun</uri></include>" + nested))
    assert len(site.walls) == 4
    assert "1 include, 2 mesh, 1 tilted collision" in caplog.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<sdf", "no XML"),
        ("<robot/>", "<robot>: expected <sdf>"),
        (sdf(), "no upright box at the height of 0.2 m"),
        (sdf(box(size="1 1")), "size of a box in geometry '' is '1 1': expected 3 finite numbers"),
        (sdf(box(size="1 1 nan")), "expected 3 finite numbers"),
        (sdf(box(at="0 0 0")), "pose of collision 'c' is '0 0 0': expected 6 finite numbers"),
        (sdf(box(at="0 0 0 0 0 x")), "expected 6 finite numbers"),
        (
            sdf(box()).replace("<link name='wall'><pose>", "<link name='wall'><pose relative_to='door'>"),
            "link 'wall': its pose refers",
        ),
        (sdf("<collision name='c'><geometry><box/></geometry></collision>"), "size of a box"),
    ],
)
def test_what_cannot_be_read_is_one_line(text, message, read):
    with pytest.raises(WorldError, match=message) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_the_walls_of_the_house_are_those_of_its_boxes(house):
    """Every box that reaches through the plane is inside an outline or on it, and every wall lies on some box.

    The boxes of the house hang under models and links that turn about the vertical only, by the names used here.
    """
    site = read_site(house)
    assert findings(site.walls) == []
    boxes = []
    root = ElementTree.parse(house).getroot().find("model")
    for parent in (root, *root.findall("model")):
        base = pose() if parent is root else planar(parent)
        for link in parent.findall("link"):
            for shape in link.findall("collision"):
                size = shape.findtext("geometry/box/size")
                z = height(shape) + height(link) + (0.0 if parent is root else height(parent))
                if size and abs(z - 0.2) <= float(size.split()[2]) / 2.0:
                    x, y, yaw = compose(compose(base, planar(link)), planar(shape))
                    half = np.array(size.split()[:2], dtype=float) / 2.0
                    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
                    boxes.append(shapely.Polygon(square @ rotation(yaw).T + (x, y)))
    # Cracks of less than a millimetre between boxes that nearly touch are closed here as the reader closes them.
    solid = shapely.union_all(boxes).buffer(5e-4, join_style="mitre").buffer(-5e-4, join_style="mitre")
    drawn = shapely.multilinestrings(list(site.walls.reshape(-1, 2, 2)))
    assert len(boxes) > 40
    # Half a millimetre of rounding in x and in y, and as much where it makes a step between two boxes.
    assert shapely.hausdorff_distance(drawn, solid.boundary, densify=0.01) < 1.5e-3


def planar(element):
    values = [float(field) for field in element.findtext("pose", "0 0 0 0 0 0").split()]
    return pose(values[0], values[1], values[5])


def height(element):
    return float(element.findtext("pose", "0 0 0 0 0 0").split()[2])
