"""Every way a frame enters the program; knows nothing of estimation."""

from drivers.carmen import CarmenLog
from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource

__all__ = ["CarmenLog", "Frame", "FrameSource", "LogFormatError"]
