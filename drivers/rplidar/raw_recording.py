"""The raw bytes of a scanner in a recording, beside its frames: written as they come, and decoded again."""

import base64
import binascii
import logging
import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from drivers.errors import LogFormatError
from drivers.frame import Frame
from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording
from drivers.rplidar.protocol.answers import Answer
from drivers.rplidar.protocol.counts import Counts
from drivers.rplidar.revolutions import RevolutionDecoder, ScanStream
from features.se2 import Array, Pose
from features.sensor import Mounting

logger = logging.getLogger(__name__)


class RawRecorder:
    """Writes the bytes of the scans into a recording, with the times at which they came; a tap of the driver.

    Parameters
    ----------
    recorder : that takes the frames too.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def begin(self, stream: ScanStream, time: float) -> None:
        """Note that a scan begins."""
        content = {"answer": int(stream.answer), "us_per_sample": stream.us_per_sample, "baud": stream.baud}
        self._recorder.note({"stream": content, "time": time}, time)

    def chunk(self, data: bytes, time: float) -> None:
        """Take bytes down, which came at a time [s since 1970]."""
        self._recorder.note({"bytes": base64.b64encode(data).decode(), "time": time}, time)


class RawRecording:
    """Frames of a recording, decoded anew from the bytes of the scanner as they came.

    Every revolution comes, also those that were dropped while it was recorded. Odometry is that of the recorded frames,
    interpolated.

    Parameters
    ----------
    path : the recording.

    Attributes
    ----------
    counts : what became of the bytes so far.

    Raises
    ------
    LogFormatError
        When made: the file is no recording, or there are no raw bytes in it.
        When iterated: a line is unusable; the frames before are yielded first.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._recording = Recording(path)
        self._path = path
        self.counts = Counts()
        if not has_raw_bytes(self._recording):
            raise LogFormatError(f"{path} holds no raw bytes of a scanner: expected what `cwlf-slam record` writes")

    @property
    def name(self) -> str:
        """What was recorded, a short name fit for a folder."""
        return self._recording.name

    @property
    def sensor(self) -> str:
        """Name of the sensor preset that fits the scanner."""
        return self._recording.sensor

    @property
    def mounting(self) -> Mounting:
        """Where the scanner sat on the robot."""
        return self._recording.mounting

    @property
    def has_odometry(self) -> bool:
        """Whether the recorded poses tell the motion."""
        return self._recording.has_odometry

    @property
    def progress(self) -> float:
        """Share of the file's bytes that has been read, 0 to 1."""
        return self._recording.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; each call starts at the first."""
        odometry = _Odometry(self._recording) if self.has_odometry else None
        self.counts = before = Counts()
        decoder: RevolutionDecoder | None = None
        for number, record in self._recording.lines():
            try:
                if "stream" in record:
                    before = self.counts
                    decoder = RevolutionDecoder(_stream(record["stream"]))
                if "bytes" not in record:
                    continue
                if decoder is None:
                    raise ValueError("bytes before their stream")
                scans = decoder.feed(base64.b64decode(record["bytes"], validate=True), float(record["time"]))
            except KeyError as error:
                raise LogFormatError(f"{self._path}, line {number}: no key {error}") from None
            except (TypeError, ValueError, binascii.Error) as error:
                raise LogFormatError(f"{self._path}, line {number}: {error}") from None
            self.counts = before + decoder.counts
            for scan in scans:
                yield Frame(scan.stamp, np.zeros(3) if odometry is None else odometry.at(scan.stamp), scan)


def has_raw_bytes(recording: Recording) -> bool:
    """Whether the raw bytes of a scanner are in a recording; they are before its first frame then."""
    first = next((record for _, record in recording.lines() if "wall" not in record), {})
    return "stream" in first


class _Odometry:
    """Odometry of the frames of a recording at any time."""

    def __init__(self, recording: Recording) -> None:
        frames = [(frame.stamp, frame.pose_odom_robot) for frame in recording]
        self._stamps = np.array([stamp for stamp, _ in frames])
        self._poses: Array = np.array([pose for _, pose in frames]).reshape(-1, 3)
        self._poses[:, 2] = np.unwrap(self._poses[:, 2])

    def at(self, stamp: float) -> Pose:
        return np.array([np.interp(stamp, self._stamps, column) for column in self._poses.T])


def _stream(content: dict[str, Any]) -> ScanStream:
    return ScanStream(Answer(content["answer"]), float(content["us_per_sample"]), int(content["baud"]))
