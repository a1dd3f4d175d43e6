"""Writes recordings frame by frame."""

import gzip
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Any, Self

import numpy as np

from drivers.errors import RecordError
from drivers.frame import Frame, SourceInfo
from drivers.recording.recording import Header
from features.se2 import Array, Pose

FLUSH_EVERY = 50
"""Largest number of frames that a killed process loses."""

FLUSH_INTERVAL = 1.0
"""Largest duration of frames that a killed process loses, by their stamps [s]."""


class Recorder:
    """A recording that is being written; a context manager.

    Frames are written as they come, so that memory does not grow and a process that is killed loses no more than
    :data:`FLUSH_EVERY` frames or those of :data:`FLUSH_INTERVAL`. The same frames give the same bytes. Threads may
    share a recorder.

    Parameters
    ----------
    path : file to write, gzipped whatever its name.
    info : what is known of the source of the frames.
    walls : the walls that the sensor sees, world frame, shape (n, 4) [m], where they are known.
    glass : whether each wall is of glass, shape (n,).
    overwrite : replace a file that is there.

    Raises
    ------
    RecordError
        There is a file already, or it cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        info: SourceInfo,
        *,
        walls: Array | None = None,
        glass: Sequence[bool] | np.ndarray = (),
        overwrite: bool = False,
    ) -> None:
        self._path = Path(path)
        self._lock = Lock()
        self._unflushed = 0
        self._flushed = -np.inf
        self._angles: Array | None = None
        self._times: Array | None = None
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file = self._path.open("wb" if overwrite else "xb")
        except FileExistsError:
            raise RecordError(f"{path} is there already: choose another name or give --overwrite") from None
        except OSError as error:
            raise RecordError(f"{path}: cannot be written: {error.strerror or error}") from None
        # No time and no name in the header of the data, so that they depend on the frames alone.
        self._gzip = gzip.GzipFile(filename="", mode="wb", fileobj=self._file, mtime=0)
        self._write(Header.of(info).model_dump())
        for k, wall in enumerate(() if walls is None else walls.tolist()):
            self._write({"wall": wall} | ({"glass": True} if len(glass) and glass[k] else {}))
        self._flush()

    def write(self, frame: Frame, truth: Pose | None = None) -> None:
        """Write a frame and, where it is known, the true pose of the robot, world frame, shape (3,) [m, m, rad].

        Ranges are rounded to the micrometre, other numbers are kept exactly.
        """
        record: dict[str, Any] = {"stamp": float(frame.stamp), "odom": frame.pose_odom_robot.tolist()}
        if truth is not None:
            record["truth"] = truth.tolist()
        if (scan := frame.scan) is not None:
            rounded = np.round(scan.ranges, 6)
            content: dict[str, Any] = {"ranges": [r if r < np.inf else None for r in rounded.tolist()]}
            if scan.stamp != frame.stamp:
                content["stamp"] = float(scan.stamp)
            if not (_same(scan.angles, self._angles) and _same(scan.times, self._times)):
                self._angles, self._times = scan.angles.copy(), None if scan.times is None else scan.times.copy()
                times = {} if scan.times is None else {"times": scan.times.tolist()}
                content["beams"] = {"angles": scan.angles.tolist()} | times
            record["scan"] = content
        self._append(record, frame.stamp)

    def note(self, record: Mapping[str, Any], stamp: float) -> None:
        """Write a line that is no frame, and that readers of frames skip; ``stamp`` is its time [s]."""
        self._append(record, stamp)

    def close(self) -> None:
        """Flush and close the file."""
        with self._lock:
            try:
                self._gzip.close()
                self._file.close()
            except OSError as error:
                raise RecordError(f"{self._path}: cannot be written: {error.strerror or error}") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _append(self, record: Mapping[str, Any], stamp: float) -> None:
        with self._lock:
            self._write(record)
            self._unflushed += 1
            if self._unflushed == FLUSH_EVERY or not 0.0 <= stamp - self._flushed < FLUSH_INTERVAL:
                self._flush()
                self._unflushed, self._flushed = 0, stamp

    def _write(self, record: Mapping[str, Any]) -> None:
        try:
            self._gzip.write(json.dumps(record, separators=(",", ":"), allow_nan=False).encode() + b"\n")
        except OSError as error:
            raise RecordError(f"{self._path}: cannot be written: {error.strerror or error}") from None

    def _flush(self) -> None:
        try:
            self._gzip.flush(zlib.Z_SYNC_FLUSH)
            self._file.flush()
        except OSError as error:
            raise RecordError(f"{self._path}: cannot be written: {error.strerror or error}") from None


def _same(a: Array | None, b: Array | None) -> bool:
    return a is b if a is None or b is None else np.array_equal(a, b)
