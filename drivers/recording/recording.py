"""Reads recordings, JSON lines in gzip: frames, and the true poses where they are known."""

import itertools
import json
import logging
import math
import os
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal, Self, TypeGuard, cast

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, SourceInfo
from drivers.log_lines import LogLine, LogLineReader
from features.errors import ScanFormatError
from features.scan import LaserScan
from features.se2 import Array, Pose
from features.sensor import Mounting

logger = logging.getLogger(__name__)

FORMAT: Literal["cwlf-recording"] = "cwlf-recording"


OTHER_LINES = frozenset({"wall", "stream", "bytes"})
"""Keys of lines that are no frames: walls, and the raw bytes of a scanner."""


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class MountingRecord(_Record):
    """Pose of the sensor on the robot, robot frame [m, m, rad]."""

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    upside_down: bool = False


class Header(_Record):
    """First line of a recording."""

    format: Literal["cwlf-recording"] = FORMAT
    version: Literal[1] = 1
    name: str = Field(min_length=1)
    sensor: str = Field(min_length=1)
    mounting: MountingRecord = MountingRecord()
    odometry: bool = True

    @classmethod
    def of(cls, info: SourceInfo) -> Self:
        """Header for the frames of a source."""
        mounting = MountingRecord(**asdict(info.mounting))
        return cls(name=info.name, sensor=info.sensor, mounting=mounting, odometry=info.has_odometry)

    @property
    def info(self) -> SourceInfo:
        """What the header says of the source of the frames."""
        return SourceInfo(self.name, self.sensor, Mounting(**self.mounting.model_dump()), self.odometry)


class Recording(FrameSource):
    """A recording, as docs/worlds.md describes it.

    Frames are yielded as they were recorded, in the order of their stamps. A last line that is cut short, as in the
    recording of a killed process, is skipped with a warning in the log of this package.

    Parameters
    ----------
    path : the recording, gzipped or not.

    Attributes
    ----------
    walls : end points ``x1 y1 x2 y2`` of the walls that the sensor saw, world frame, shape (n, 4) [m]; n is 0 where
        they are not known.
    glass : whether each wall is of glass, shape (n,).

    Raises
    ------
    LogFormatError
        When made: the file cannot be opened, or what comes before its first frame is unusable.
        When iterated: a line is unusable, or there is no scan; the frames before are yielded first.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = Path(path)
        lines = self._open()
        walls = list(itertools.takewhile(lambda item: "wall" in item[1], lines))
        try:
            self.walls: Array = np.array([record["wall"] for _, record in walls], dtype=np.float64).reshape(-1, 4)
        except (TypeError, ValueError):
            raise LogFormatError(f"{self._path}: a wall is not of four numbers `x1 y1 x2 y2`") from None
        self.glass: npt.NDArray[np.bool_] = np.array([bool(record.get("glass")) for _, record in walls], dtype=np.bool_)

    @property
    def info(self) -> SourceInfo:
        """What the header of the recording says."""
        return self._header.info

    @property
    def progress(self) -> float:
        """Share of the file's bytes that has been read, 0 to 1."""
        return self._reader.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames; each call starts at the first."""
        for frame, _ in self._frames():
            yield frame

    def truth(self) -> tuple[Array, Array]:
        """Read the true poses of those frames that have one.

        Returns
        -------
        stamps : shape (n,) [s].
        poses_world_robot : shape (n, 3) [m, m, rad].

        Raises
        ------
        LogFormatError
            A line is unusable, or no frame has a true pose.
        """
        known = [(frame.stamp, true) for frame, true in self._frames() if true is not None]
        if not known:
            raise LogFormatError(f"{self._path} has no true poses: expected a recording of a simulation")
        return np.array([stamp for stamp, _ in known]), np.array([true for _, true in known])

    def _frames(self) -> Iterator[tuple[Frame, Pose | None]]:
        """Yield each frame and the true pose of the robot, where it is known."""
        angles: Array | None = None
        times: Array | None = None
        stamp, scans = -math.inf, 0
        for line, record in self._open():
            if not OTHER_LINES.isdisjoint(record):
                continue
            try:
                if (scan := record.get("scan")) and (beams := scan.get("beams")):
                    angles = _numbers(beams["angles"])
                    times = _numbers(beams["times"]) if "times" in beams else None
                frame = _frame(record, angles, times)
                true = _pose(record["truth"]) if "truth" in record else None
            except KeyError as error:
                raise LogFormatError(f"{self._path}, line {line.number}: no key {error}") from None
            except (AttributeError, TypeError, ValueError, ScanFormatError) as error:
                raise LogFormatError(f"{self._path}, line {line.number}: {error}") from None
            if frame.stamp < stamp:
                raise LogFormatError(
                    f"{self._path}, line {line.number}: stamp goes back by {stamp - frame.stamp:.6f} s: "
                    "expected frames in order"
                )
            stamp = frame.stamp
            scans += frame.scan is not None
            yield frame, true
        if not scans:
            raise LogFormatError(f"{self._path} has no scan: expected frames with scans")

    def lines(self) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the number and the content of every line after the header.

        Raises
        ------
        LogFormatError
            A line is unusable; those before are yielded first.
        """
        for line, record in self._open():
            yield line.number, record

    def _open(self) -> Iterator[tuple[LogLine, dict[str, Any]]]:
        """Read the header, and return the records from there on."""
        self._reader = LogLineReader(self._path, "a recording")
        lines = self._reader.lines()
        first = next(lines, None)
        if first is None:
            raise LogFormatError(f"{self._path} is empty: expected a recording")
        try:
            self._header = Header.model_validate_json(first.text)
        except ValidationError as error:
            problem = error.errors(include_url=False)[0]
            where = "".join(f"{part}: " for part in problem["loc"])
            raise LogFormatError(f"{self._path}, line {first.number}: {where}{problem['msg']}") from None
        return self._records(lines)

    def _records(self, lines: Iterator[LogLine]) -> Iterator[tuple[LogLine, dict[str, Any]]]:
        for line in lines:
            try:
                record = json.loads(line.text, parse_constant=_refuse)
                if not isinstance(record, dict):
                    raise ValueError(f"{type(record).__name__}: expected an object")
            except ValueError as error:
                if line.suspect or (line.last and not line.ended):
                    logger.warning("%s, line %d: skipped, the end of the file is cut short", self._path, line.number)
                    return
                raise LogFormatError(f"{self._path}, line {line.number}: {error}") from None
            yield line, record


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant}: expected a finite number, or null for no return")


def _frame(record: dict[str, Any], angles: Array | None, times: Array | None) -> Frame:
    stamp = float(_numbers([record["stamp"]])[0])
    odometry = _pose(record["odom"])
    scan = record.get("scan")
    if scan is None:
        return Frame(stamp, odometry)
    if angles is None:
        raise ValueError("the first scan has no beams: expected their angles")
    ranges = _numbers(scan["ranges"], no_return=True)
    return Frame(stamp, odometry, LaserScan(ranges, angles, scan.get("stamp", stamp), times))


def _pose(values: Any) -> Pose:
    numbers = _numbers(values)
    if numbers.shape != (3,):
        raise ValueError(f"a pose of {len(numbers)} numbers: expected x, y and theta")
    return numbers


def _numbers(values: Any, *, no_return: bool = False) -> Array:
    """Numbers of a list; null among ranges becomes infinity."""
    if not _is_list_of(values, {int, float, type(None)} if no_return else {int, float}):
        raise ValueError(f"{str(values)[:40]}: expected a list of numbers")
    numbers = np.array(values, dtype=np.float64)
    return np.where(np.isnan(numbers), math.inf, numbers) if no_return else numbers


def _is_list_of(values: Any, kinds: set[type]) -> TypeGuard[list[float | None]]:
    return isinstance(values, list) and kinds.issuperset(map(type, cast(list[object], values)))
