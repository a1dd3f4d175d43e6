# pyright: reportUnknownMemberType=false
# ezdxf leaves the types of some arguments open.
"""Write the apartment as a ROS map (PGM and YAML) and as a DXF drawing: python draw_floor_plans.py FOLDER."""

import itertools
import sys
from pathlib import Path

import ezdxf.filemanagement
import numpy as np
import shapely
from ezdxf.enums import InsertUnits
from PIL import Image

from sim import find_site

RESOLUTION, MARGIN = 0.05, 0.5
"""Side of a cell, and what is drawn around the walls [m]."""


def main() -> None:
    """Write ``apartment-map.pgm``, ``apartment-map.yaml`` and ``apartment-plan.dxf``."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    lines = [shapely.LineString(wall.reshape(2, 2)) for wall in find_site("apartment").walls]
    outline, *furniture = sorted(shapely.get_parts(shapely.polygonize(lines)), key=lambda face: -face.area)
    write_map(folder / "apartment-map.yaml", outline)
    write_plan(folder / "apartment-plan.dxf", outline, furniture)
    print(f"{folder}: apartment-map.yaml, apartment-map.pgm, apartment-plan.dxf")


def write_map(path: Path, free: shapely.Polygon) -> None:
    """Draw the cells whose centre is not free black, the others white."""
    x1, y1, x2, y2 = free.bounds
    x, y = np.meshgrid(
        np.arange(x1 - MARGIN + RESOLUTION / 2, x2 + MARGIN, RESOLUTION),
        np.arange(y1 - MARGIN + RESOLUTION / 2, y2 + MARGIN, RESOLUTION),
    )
    cells = np.where(shapely.contains_xy(free, x, y), 254, 0).astype(np.uint8)
    Image.fromarray(np.flipud(cells)).save(path.with_suffix(".pgm"))
    path.write_text(
        f"image: {path.stem}.pgm\nresolution: {RESOLUTION}\norigin: [{x1 - MARGIN}, {y1 - MARGIN}, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def write_plan(path: Path, outline: shapely.Polygon, furniture: list[shapely.Polygon]) -> None:
    """Draw the outline in lines and each piece of furniture as a block, in millimetres."""
    drawing = ezdxf.filemanagement.new(units=InsertUnits.Millimeters)
    corners = 1000.0 * np.asarray(outline.exterior.coords)
    for start, end in itertools.pairwise(corners):
        drawing.modelspace().add_line(start, end)
    for number, piece in enumerate(furniture):
        middle = np.asarray(piece.centroid.coords[0])
        block = drawing.blocks.new(f"PIECE-{number}")
        block.add_lwpolyline(1000.0 * (np.asarray(piece.exterior.coords)[:-1] - middle), close=True)
        drawing.modelspace().add_blockref(block.name, 1000.0 * middle)
    drawing.saveas(path)


main()
