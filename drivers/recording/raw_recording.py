"""Raw bytes of a scanner in a recording, beside its frames: recorded as they arrive, and decoded again."""

import base64
import binascii
import logging
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from drivers.counts import Counts
from drivers.errors import DriverError, LogFormatError
from drivers.frame import Frame, FrameSource, SourceInfo
from drivers.live_source import RawDecoder, RawStream
from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording
from drivers.scanners import find_scanner
from features.se2 import Array, Pose

logger = logging.getLogger(__name__)

DEFAULT_SCANNER = "rplidar"
"""Kind of scanner where the record of a stream names none."""


class RawRecorder:
    """Writes the bytes of a scanner into a recording, with their arrival times; a ``drivers.live_source.RawTap``.

    Parameters
    ----------
    recorder : of the recording, which may receive frames too.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder = recorder

    def begin(self, stream: RawStream, time: float) -> None:
        """Record that a scan starts at a time [s since 1970]."""
        self._recorder.note({"stream": stream.to_record(), "time": time}, time)

    def chunk(self, data: bytes, time: float) -> None:
        """Record bytes that arrived at a time [s since 1970]."""
        self._recorder.note({"bytes": base64.b64encode(data).decode(), "time": time}, time)


class RawRecording(FrameSource):
    """Frames of a recording, decoded again from the recorded bytes of the scanner.

    It yields every revolution, also those that were dropped while they were recorded. Odometry is interpolated between
    the recorded frames.

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
    def info(self) -> SourceInfo:
        """That of the recording."""
        return self._recording.info

    @property
    def progress(self) -> float:
        """Share of the file's bytes that has been read, 0 to 1."""
        return self._recording.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; each call starts at the first."""
        odometry = _Odometry(self._recording) if self.has_odometry else None
        self.counts = before = Counts()
        decoder: RawDecoder | None = None
        for number, record in self._recording.lines():
            try:
                if "stream" in record:
                    before = self.counts
                    decoder = _decoder(record["stream"])
                if "bytes" not in record:
                    continue
                if decoder is None:
                    raise ValueError("bytes before their stream")
                scans = decoder.feed(base64.b64decode(record["bytes"], validate=True), float(record["time"]))
            except KeyError as error:
                raise LogFormatError(f"{self._path}, line {number}: no key {error}") from None
            except (AttributeError, TypeError, ValueError, binascii.Error, DriverError) as error:
                raise LogFormatError(f"{self._path}, line {number}: {error}") from None
            self.counts = before + decoder.counts
            for scan in scans:
                yield Frame(scan.stamp, np.zeros(3) if odometry is None else odometry.at(scan.stamp), scan)


def has_raw_bytes(recording: Recording) -> bool:
    """Whether a recording holds the raw bytes of a scanner; they then begin before its first frame."""
    first = next((record for _, record in recording.lines() if "wall" not in record), None)
    return first is not None and "stream" in first


class _Odometry:
    """Odometry of the frames of a recording at any time."""

    def __init__(self, recording: Recording) -> None:
        poses = [(frame.stamp, frame.pose_odom_robot) for frame in recording]
        self._stamps = np.array([stamp for stamp, _ in poses])
        x, y, theta = np.array([pose for _, pose in poses]).reshape(-1, 3).T
        self._columns: tuple[Array, Array, Array] = x, y, np.unwrap(theta)

    def at(self, stamp: float) -> Pose:
        return np.array([float(np.interp(stamp, self._stamps, column)) for column in self._columns])


def _decoder(record: Mapping[str, Any]) -> RawDecoder:
    name = record.get("scanner", DEFAULT_SCANNER)
    decoder = find_scanner(name).decoder
    if decoder is None:
        raise ValueError(f"bytes of a scanner {name!r} cannot be decoded")
    return decoder(record)
