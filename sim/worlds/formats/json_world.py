"""Our own format of worlds, to be written by hand: JSON of lines and outlines, and a path."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from features.se2 import Array
from sim.errors import WorldError
from sim.worlds.site import Site

LARGEST = 1e6
"""Largest coordinate [m]: beyond it, the rounding of a double comes near the distance at which walls meet (1e-9 m)."""

Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Point = tuple[Coordinate, Coordinate]

REASONS = {"extra_forbidden": "no such key", "missing": "is missing"}
"""Messages in the terms of the user in place of those of pydantic, by its type of error."""


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class Wall(_Model):
    """Walls from point to point."""

    points: tuple[Point, ...] = Field(min_length=2, description="end points, each wall from one to the next, x y [m]")
    closed: bool = Field(default=False, description="a last wall goes from the last point to the first")
    glass: bool = Field(default=False, description="the walls are of glass")


class WorldFile(_Model):
    """A world and a path through it."""

    format: Literal["cwlf-world"] = Field(description="says that this is a world")
    version: Literal[1] = Field(description="of this format")
    name: str | None = Field(default=None, min_length=1, description="short name; by default that of the file")
    walls: tuple[Wall, ...] = Field(min_length=1, description="lines and outlines")
    waypoints: tuple[Point, ...] | None = Field(
        default=None, min_length=2, description="path of a robot, x y [m]; it starts on the first one"
    )


def read_json(path: Path) -> Site:
    """Read a world of our own format; docs/worlds.md describes it.

    Raises
    ------
    WorldError
        The file is no JSON of this form; the message names the key.
    """
    try:
        content = WorldFile.model_validate_json(path.read_bytes())
    except ValidationError as error:
        errors = error.errors(include_url=False)
        where = ".".join(str(part) for part in errors[0]["loc"])
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        reason = REASONS.get(errors[0]["type"], errors[0]["msg"])
        raise WorldError(f"{path}: {where + ': ' if where else ''}{reason}{more}") from None
    walls: list[Array] = []
    glass: list[npt.NDArray[np.bool_]] = []
    for wall in content.walls:
        points = np.array(wall.points)
        ends = np.roll(points, -1, axis=0)
        lines = np.hstack([points, ends]) if wall.closed else np.hstack([points, ends])[:-1]
        walls.append(lines)
        glass.append(np.full(len(lines), wall.glass))
    waypoints = None if content.waypoints is None else np.array(content.waypoints)
    return Site(content.name or path.stem, np.vstack(walls), np.concatenate(glass), waypoints)
