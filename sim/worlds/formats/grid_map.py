"""Reader of occupancy grids of the ROS map_server, an image and its YAML: outlines of occupied cells become walls."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
import yaml
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from features.se2 import Array, pose, transform
from sim.errors import WorldError
from sim.worlds.formats.grid_outlines import trace_outlines
from sim.worlds.site import Site


class MapFile(BaseModel):
    """The keys of a map's YAML that determine its walls; others are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    image: str = Field(min_length=1, description="file of the image, relative to the YAML")
    resolution: float = Field(gt=0.0, description="side of a cell [m]")
    origin: tuple[float, float, float] = Field(description="pose of the lower left corner of the image [m, m, rad]")
    occupied_thresh: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        default=0.65, description="a cell of a higher probability is occupied"
    )
    negate: bool = Field(default=False, description="white is occupied instead of black")
    mode: Literal["trinary", "scale"] = Field(default="trinary", description="the occupied cells are the same in both")


def read_map(path: Path) -> Site:
    """Read a map and outline its occupied cells by straight walls.

    A cell is occupied if its probability, ``(255 - value) / 255`` or ``value / 255`` where the map is negated, is above
    ``occupied_thresh``. Walls have any direction, and lie within about half a cell of the boundary of the cells.

    Parameters
    ----------
    path : YAML file.

    Raises
    ------
    WorldError
        The YAML or its image cannot be read, a key is missing or wrong, or no cell is occupied.
    """
    try:
        content = MapFile.model_validate(yaml.safe_load(path.read_bytes()))
    except yaml.YAMLError as error:
        raise WorldError(f"{path}: no YAML: {' '.join(str(error).split())}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise WorldError(f"{path}: {where + ': ' if where else ''}{first['msg']}: expected the YAML of a map") from None
    values = _image(path.parent / content.image, path)
    probabilities = values / 255.0 if content.negate else (255.0 - values) / 255.0
    # Row 0 is the uppermost of an image, but the lowest of the map.
    rings = trace_outlines(np.flipud(probabilities > content.occupied_thresh))
    if not rings:
        raise WorldError(f"{path}: no cell of {content.image} is occupied: expected walls")
    walls = _walls(rings, content)
    return Site(path.stem, walls, np.zeros(len(walls), dtype=np.bool_), None)


def _walls(rings: list[Array], content: MapFile) -> Array:
    """Return the walls, world frame, shape (n, 4) [m], of outlines in cells from the lower left corner of the image."""
    pose_world_image = pose(*content.origin)
    vertices = [np.round(transform(pose_world_image, ring * content.resolution), 6) for ring in rings]
    return np.vstack([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in vertices])


def _image(image: Path, named_by: Path) -> npt.NDArray[np.float64]:
    """Read the grey values of an image, 0 to 255, shape (rows, columns)."""
    try:
        with Image.open(image) as opened:
            return np.asarray(opened.convert("L"), dtype=np.float64)
    except FileNotFoundError:
        raise WorldError(f"{named_by}: no image {image}") from None
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise WorldError(f"{image}: cannot be read as an image: {error}") from None
