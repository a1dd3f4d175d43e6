"""CARMEN logs: read as a source of frames, and written.

The room promises that damage at the end of a log costs no more than the damaged lines. It may import the modules of
``drivers`` itself and ``features``.
"""

from drivers.carmen.export import write_carmen
from drivers.carmen.log import CarmenLog

__all__ = ["CarmenLog", "write_carmen"]
