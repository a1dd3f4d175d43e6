"""Reader of Gazebo models and worlds (SDF): upright collision boxes become walls."""

import logging
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import shapely

from features.se2 import Array, Pose, compose, pose, transform
from sim.errors import WorldError
from sim.worlds.floor_plan import outlines
from sim.worlds.site import Site

logger = logging.getLogger(__name__)

SCAN_HEIGHT = 0.2
"""Height of the scan plane above the ground, as of a lidar on a small robot [m]: a lintel above it, or a sill below it,
is no wall."""

_MILLIMETRE = 1e-3
"""Boxes are joined on a grid of this width [m], so that walls fit together although their poses are rounded."""

_UPRIGHT = 1e-3
"""A box that leans by less is upright [rad]: over a height of 2.5 m it is off by 2.5 mm, less than a lidar resolves."""


def read_sdf(path: Path) -> Site:
    """Read the outlines of the collision boxes of a model or world in the plane at :data:`SCAN_HEIGHT`.

    Boxes that overlap become one outline. Other shapes are left out, with a warning in the log.

    Raises
    ------
    WorldError
        The file is no SDF, a pose or size is malformed, a pose refers to another frame, or no box is at this height.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise WorldError(f"{path}: no XML: {error}") from None
    if root.tag != "sdf":
        raise WorldError(f"{path}: <{root.tag}>: expected <sdf>")
    left_out: Counter[str] = Counter()
    try:
        boxes = list(_boxes(root, pose(), 0.0, left_out))
    except _SdfError as error:
        raise WorldError(f"{path}: {error}") from None
    if left_out:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(left_out.items()))
        logger.warning("%s: left out: %s: only upright boxes are walls", path, kinds)
    if not boxes:
        raise WorldError(f"{path}: no upright box at the height of {SCAN_HEIGHT:g} m: expected walls of boxes")
    rings = list(outlines(shapely.union_all([shapely.Polygon(box) for box in boxes], grid_size=_MILLIMETRE)))
    walls = np.vstack([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in rings])
    named = root.find("world")
    named = root.find("model") if named is None else named
    name = path.stem if named is None else named.get("name", path.stem)
    return Site(name, walls, np.zeros(len(walls), dtype=np.bool_), None)


class _SdfError(Exception):
    """Content of the file that cannot be read; the message names the element."""


def _boxes(
    element: ElementTree.Element, pose_world_parent: Pose, height: float, left_out: Counter[str]
) -> Iterator[Array]:
    """Yield the corners, world frame, shape (4, 2) [m], of the boxes at scan height in an element.

    ``height`` is that of the parent [m]; ``left_out`` counts the shapes that do not become walls, by kind.
    """
    x, y, z, roll, pitch, yaw = _pose(element)
    if max(abs(roll), abs(pitch)) > _UPRIGHT:
        left_out[f"tilted {element.tag}"] += 1
        return
    pose_world_element = compose(pose_world_parent, pose(x, y, yaw))
    height += z
    for child in element:
        if child.tag in ("world", "model", "link", "collision", "geometry"):
            yield from _boxes(child, pose_world_element, height, left_out)
        elif child.tag == "include" or (element.tag == "geometry" and child.tag != "box"):
            left_out[child.tag] += 1
        elif child.tag == "box":
            length, width, tall = _numbers(child.find("size"), f"size of a box in {_label(element)}", 3)
            if abs(height - SCAN_HEIGHT) <= tall / 2.0:
                corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * (length, width)
                yield transform(pose_world_element, corners)


def _pose(element: ElementTree.Element) -> list[float]:
    """Return x, y, z [m], roll, pitch and yaw [rad] of an element in the frame of its parent."""
    found = element.find("pose")
    if found is None:
        return [0.0] * 6
    if found.get("frame") or found.get("relative_to"):
        raise _SdfError(f"{_label(element)}: its pose refers to another frame: expected one relative to its parent")
    values = _numbers(found, f"pose of {_label(element)}", 6)
    if found.get("degrees") == "true":
        values[3:] = map(math.radians, values[3:])
    return values


def _numbers(element: ElementTree.Element | None, what: str, count: int) -> list[float]:
    text = "" if element is None or element.text is None else element.text
    try:
        values = [float(field) for field in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        raise _SdfError(f"{what} is {text.strip()[:60]!r}: expected {count} finite numbers")
    return values


def _label(element: ElementTree.Element) -> str:
    return f"{element.tag} {element.get('name', '')!r}"
