"""The reader of world files: it chooses the reader of the format."""

from collections.abc import Callable
from pathlib import Path

from sim.errors import WorldError
from sim.worlds.site import Site

_SUFFIXES = {".json": "json", ".sdf": "sdf", ".world": "sdf", ".yaml": "map", ".yml": "map", ".dxf": "dxf"}
_IMAGES = {".pgm", ".png", ".bmp"}


def read_site(path: Path) -> Site:
    """Read a world from a file of any known format: its walls, and its path where the file holds one.

    The formats are our own JSON (docs/worlds.md), Gazebo SDF, the YAML of a ROS map, and DXF. The suffix tells the
    format; where it is unknown, the first character does.

    Parameters
    ----------
    path : file to read.

    Raises
    ------
    WorldError
        The file cannot be read, is of none of these formats, or needs a package that is not installed.
    """
    try:
        with path.open("rb") as file:
            start = file.read(1024).lstrip()
    except IsADirectoryError:
        raise WorldError(f"{path} is a directory: expected the file of a world") from None
    except OSError as error:
        raise WorldError(f"{path}: cannot be read: {error.strerror or error}") from None
    suffix = path.suffix.lower()
    if suffix in _IMAGES:
        raise WorldError(f"{path}: an image alone has no scale: give the map's YAML file, which names the image")
    return _reader(path, _SUFFIXES.get(suffix) or {b"{": "json", b"<": "sdf"}.get(start[:1]))(path)


def _reader(path: Path, file_format: str | None) -> Callable[[Path], Site]:
    match file_format:
        case "json":
            from sim.worlds.formats.json_world import read_json

            return read_json
        case "sdf":
            from sim.worlds.formats.sdf_world import read_sdf

            return read_sdf
        case "map":
            from sim.worlds.formats.grid_map import read_map

            return read_map
        case "dxf":
            try:
                from sim.worlds.formats.dxf_world import read_dxf
            except ModuleNotFoundError as error:
                if error.name != "ezdxf":
                    raise
                raise WorldError(f"{path}: DXF needs ezdxf: pip install ezdxf") from None
            return read_dxf
        case _:
            raise WorldError(f"{path}: no format of a world: expected {', '.join(_SUFFIXES)}")
