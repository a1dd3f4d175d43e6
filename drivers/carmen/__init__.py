"""Logs of CARMEN: read as a source of frames, and written."""

from drivers.carmen.export import write_carmen
from drivers.carmen.log import CarmenLog

__all__ = ["CarmenLog", "write_carmen"]
