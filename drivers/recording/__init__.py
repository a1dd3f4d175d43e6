"""Recordings, the project's own log: frames as lines of JSON, read and written."""

from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording

__all__ = ["Recorder", "Recording"]
