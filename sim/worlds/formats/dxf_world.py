"""Reader of floor plans of CAD programs (DXF): lines and polylines of the model space become walls."""

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import ezdxf.filemanagement
import ezdxf.path
import numpy as np
from ezdxf import units
from ezdxf.entities.dxfgfx import DXFGraphic
from ezdxf.entities.insert import Insert
from ezdxf.enums import InsertUnits

from features.se2 import Array
from sim.errors import WorldError
from sim.worlds.floor_plan import MERGE
from sim.worlds.site import Site

logger = logging.getLogger(__name__)

SAGITTA = 0.005
"""An arc in a polyline becomes straight walls that differ from it by no more than this [m]: less than the noise of a
lidar."""


def read_dxf(path: Path) -> Site:
    """Read the lines and polylines of a drawing and of its inserted blocks, and convert them to metres ($INSUNITS).

    Layers that are off or frozen are ignored; other entities are left out, with a warning in the log. Coordinates are
    rounded to a micrometre, so that ends of lines that differ by rounding alone coincide.

    Raises
    ------
    WorldError
        The file is no DXF, its drawing has no unit of length, or there is no line in it.
    """
    try:
        drawing = ezdxf.filemanagement.readfile(path)  # pyright: ignore[reportUnknownMemberType]  # its path is untyped
    except Exception as error:  # on a damaged file ezdxf raises errors of many types
        reason = " ".join(str(error).split()) or type(error).__name__
        raise WorldError(f"{path}: cannot be read as DXF: {reason}") from None
    try:
        metres = units.conversion_factor(InsertUnits(drawing.units), InsertUnits.Meters)
    except (TypeError, ValueError):
        raise WorldError(f"{path}: the drawing's unit ($INSUNITS) is {drawing.units}: expected one of length") from None
    hidden = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()}
    left_out: Counter[str] = Counter()
    walls = [
        np.hstack([points[:-1], points[1:]])
        for points in _lines(drawing.modelspace(), hidden, SAGITTA / metres, left_out)
    ]
    if left_out:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(left_out.items()))
        logger.warning("%s: left out: %s: only lines and polylines are walls", path, kinds)
    if not walls:
        raise WorldError(f"{path}: no line and no polyline in the model space: expected walls")
    all_walls = np.round(np.vstack(walls) * metres / MERGE) * MERGE
    return Site(path.stem, all_walls, np.zeros(len(all_walls), dtype=np.bool_), None)


def _lines(entities: Iterable[DXFGraphic], hidden: set[str], sagitta: float, left_out: Counter[str]) -> Iterator[Array]:
    """Yield the points, shape (n, 2), of each line and polyline [drawing units]; ``left_out`` counts other entities."""
    for entity in entities:
        if entity.dxf.layer.lower() in hidden:
            continue
        if isinstance(entity, Insert):
            for insert in entity.multi_insert() if entity.mcount > 1 else [entity]:
                skipped: list[DXFGraphic] = []
                parts = insert.virtual_entities(skipped_entity_callback=lambda part, _, to=skipped: to.append(part))
                yield from _lines(parts, hidden, sagitta, left_out)
                left_out.update(part.dxftype() for part in skipped)
            continue
        try:
            if entity.dxftype() not in ("LINE", "LWPOLYLINE", "POLYLINE"):
                raise TypeError
            points = [(point.x, point.y) for point in ezdxf.path.make_path(entity).flattening(sagitta)]
        except TypeError:  # from make_path: the polyline is a mesh
            left_out[entity.dxftype()] += 1
            continue
        yield np.array(points)
