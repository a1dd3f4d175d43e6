"""Recordings, the project's own log format: frames, and the raw bytes of a scanner, as lines of JSON.

The room promises that what a process writes until it is killed can be read. It may import the modules of ``drivers``
itself and ``features``; the decoder of a scanner's bytes is found through ``drivers.scanners``.
"""

from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording

__all__ = ["Recorder", "Recording"]
