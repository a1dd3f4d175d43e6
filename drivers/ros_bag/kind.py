"""Detects ROS bags by name and first bytes, without a library."""

from pathlib import Path
from typing import Literal

BagKind = Literal["rosbag1", "mcap", "sqlite3"]

MAGIC: dict[BagKind, bytes] = {
    "rosbag1": b"#ROSBAG V",
    "mcap": b"\x89MCAP0\r\n",
    "sqlite3": b"SQLite format 3\0",
}
"""First bytes of a file of each kind."""

SUFFIXES = (".bag", ".mcap", ".db3")
"""Suffixes that only bags have."""


def bag_kind(path: Path) -> BagKind | None:
    """Kind of a file by its first bytes; None where it is no bag, or cannot be read."""
    try:
        with path.open("rb") as file:
            start = file.read(16)
    except OSError:
        return None
    return next((kind for kind, magic in MAGIC.items() if start.startswith(magic)), None)


def is_ros_bag(path: Path) -> bool:
    """Whether a path is to be read as a ROS bag: a folder, a file that begins as one, or one that is named so."""
    return path.is_dir() or path.suffix.lower() in SUFFIXES or bag_kind(path) is not None


def storage_files(folder: Path) -> list[Path]:
    """Files of a ROS 2 bag, in the order in which they were written: their names end with a number that grows."""
    files = [path for path in folder.iterdir() if path.suffix in SUFFIXES]
    return sorted(files, key=lambda path: (len(path.name), path.name))
