"""Every way a frame enters the program; knows nothing of estimation."""

from drivers.carmen.export import write_carmen
from drivers.carmen.log import CarmenLog
from drivers.errors import DriverError, LogFormatError, RecordError
from drivers.frame import Frame, FrameSource
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
    "is_recording",
    "open_log",
    "write_carmen",
]
