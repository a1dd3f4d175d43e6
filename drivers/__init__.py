"""Every way in which frames enter the program: log readers, recordings and live scanners.

The package promises that each of them is a :class:`FrameSource`: frames in the order of their stamps, and what the
source knows of its sensor. It knows nothing of estimation, and imports only ``features``. Its rooms may import the
modules of the package itself; of each other only ``rplidar`` imports ``recording``.
"""

from drivers.carmen.export import write_carmen
from drivers.carmen.log import CarmenLog
from drivers.errors import DriverError, LogFormatError, RecordError
from drivers.frame import Frame, FrameSource, SourceInfo
from drivers.open_log import is_recording, open_log
from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording
from drivers.rplidar import Rplidar

__all__ = [
    "CarmenLog",
    "DriverError",
    "Frame",
    "FrameSource",
    "LogFormatError",
    "RecordError",
    "Recorder",
    "Recording",
    "Rplidar",
    "SourceInfo",
    "is_recording",
    "open_log",
    "write_carmen",
]
