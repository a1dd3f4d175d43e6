"""Reader of the waypoints of a robot from a file."""

import json
import math
from pathlib import Path

import numpy as np

from features.se2 import Array
from sim.errors import WorldError

COLUMNS = "x,y"
"""Columns of a file of lines, as messages name them."""


def read_waypoints(path: Path) -> Array:
    """Read waypoints, world frame [m], from lines ``x,y`` or from a JSON list ``[[x, y], ...]``.

    Lines may have blanks in place of the comma; a first line ``x,y``, and lines that start with ``#``, are skipped.

    Parameters
    ----------
    path : file to read.

    Returns
    -------
    Waypoints, shape (n, 2), n >= 2 [m].

    Raises
    ------
    WorldError
        The file cannot be read, a line is not of two finite numbers, or there are fewer than two.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise WorldError(f"{path} is not text: expected lines `{COLUMNS}`") from None
    except OSError as error:
        raise WorldError(f"{path}: cannot be read: {error.strerror or error}") from None
    points = _from_json(path, text) if text.lstrip().startswith("[") else _from_lines(path, text)
    if len(points) < 2:
        raise WorldError(f"{path}: {len(points)} waypoints: expected at least two")
    return np.array(points)


def _from_lines(path: Path, text: str) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.replace(",", " ").split()
        if not fields or fields[0].startswith("#") or (not points and fields == ["x", "y"]):
            continue
        points.append(_point(fields, f"{path}, line {number}"))
    return points


def _from_json(path: Path, text: str) -> list[tuple[float, float]]:
    try:
        content = json.loads(text)
    except ValueError as error:
        raise WorldError(f"{path}: no JSON: {error}") from None
    return [_point(item, f"{path}, waypoint {number}") for number, item in enumerate(content)]


def _point(values: object, where: str) -> tuple[float, float]:
    try:
        x, y = map(float, values)  # pyright: ignore[reportArgumentType]  # other types raise the errors below
    except (TypeError, ValueError):
        raise WorldError(f"{where}: {str(values)[:60]}: expected x and y [m]") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise WorldError(f"{where}: ({x:g}, {y:g}): expected finite x and y [m]")
    return x, y
