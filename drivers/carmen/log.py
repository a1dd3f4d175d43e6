"""CARMEN logs, plain or gzipped, as a source of frames in the order of their stamps."""

import itertools
import logging
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, SourceInfo
from drivers.log_lines import LogLine, LogLineReader
from drivers.reorder import REORDER_WINDOW, ReorderWindow
from features.errors import ScanFormatError
from features.scan import LaserScan
from features.se2 import Array, pose
from features.sensor import Mounting

logger = logging.getLogger(__name__)

Parsed = TypeVar("Parsed")


class CarmenLog(FrameSource):
    """A CARMEN log: scans of `FLASER` and `ROBOTLASER1`, odometry of these and of `ODOM`, mounting of `PARAM` lines.

    Frames come sorted by the ipc stamp, those of equal stamps in the order of the file. Other messages are skipped.
    A last line that is cut short, and the end of a gzip file that is cut short or damaged, are skipped with a warning
    in the log of this package.

    Parameters
    ----------
    path : the log; gzip data are recognised by their first bytes, whatever the name.

    Raises
    ------
    LogFormatError
        When made: the file cannot be opened or is empty, or what comes before its first record is unusable.
        When iterated: a line is unusable, a stamp goes back by more than :data:`REORDER_WINDOW`, or there is no scan;
        the frames of all lines before are yielded first.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = Path(path)
        self._unread: Iterator[LogLine] | None = self._open()

    @property
    def info(self) -> SourceInfo:
        """Name of the file; the SICK LMS, the scanner of nearly all CARMEN logs; the mounting of the `PARAM` lines."""
        return SourceInfo(_stem(self._path), "sick-lms", self._mounting)

    @property
    def progress(self) -> float:
        """Share of the file's bytes, compressed ones if it is compressed, that has been read, 0 to 1."""
        return self._reader.progress

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of their stamps; each call starts at the first."""
        lines, self._unread = self._unread or self._open(), None
        window = ReorderWindow()
        failure: LogFormatError | None = None
        scans = 0
        try:
            for line in lines:
                frame = self._parse(line)
                if frame is not None:
                    scans += frame.scan is not None
                    yield from self._sort(window, frame, line)
        except LogFormatError as error:
            failure = error
        yield from window.flush()
        if failure is not None:
            raise failure
        if not scans:
            raise LogFormatError(f"{self._path} has no scan: expected FLASER or ROBOTLASER1 records of a CARMEN log")

    def _open(self) -> Iterator[LogLine]:
        """Read the mounting, up to the first record, and return the lines from this record on."""
        self._reader = LogLineReader(self._path)
        self._mounting = Mounting()
        lines = self._reader.lines()
        empty = True
        for line in lines:
            empty = False
            fields = line.text.split()
            if fields[0] in RECORD_PARSERS:
                lines = itertools.chain([line], lines)
                break
            self._mounting = self._guard(line, self._mounted, fields) or self._mounting
        if empty:
            raise LogFormatError(f"{self._path} is empty: expected a CARMEN log")
        return lines

    def _parse(self, line: LogLine) -> Frame | None:
        fields = line.text.split()
        parser = RECORD_PARSERS.get(fields[0])
        if parser is not None:
            return self._guard(line, parser, fields)
        if self._guard(line, self._mounted, fields) not in (None, self._mounting):
            logger.warning(
                "%s, line %d: ignored, this part of the mounting comes after the first record", self._path, line.number
            )
        return None

    def _mounted(self, fields: list[bytes]) -> Mounting:
        return _parse_mounting(fields, self._mounting)

    def _guard(self, line: LogLine, parser: Callable[[list[bytes]], Parsed], fields: list[bytes]) -> Parsed | None:
        """Apply a parser of fields; None, with a warning, where the line is the cut or damaged end of the file."""
        try:
            _check_text(line)
            return parser(fields)
        except (_FieldError, ScanFormatError) as error:
            if not (line.suspect or (line.last and _is_cut(line, fields, error))):
                raise LogFormatError(f"{self._path}, line {line.number}: {error}") from None
            logger.warning(
                "%s, line %d: skipped, the end of the file is cut short or damaged: %s", self._path, line.number, error
            )
            return None

    def _sort(self, window: ReorderWindow, frame: Frame, line: LogLine) -> Iterator[Frame]:
        if frame.stamp < window.yielded:
            raise LogFormatError(
                f"{self._path}, line {line.number}: stamp goes back by {window.newest - frame.stamp:.3f} s "
                f"from that of line {window.newest_line}: expected records in order to within {REORDER_WINDOW:g} s"
            )
        return window.push(frame, line.number)


def _stem(path: Path) -> str:
    """Name of a file without `.clf`, `.log` and `.gz`."""
    name = path.name
    for suffixes in ((".gz",), (".clf", ".log")):
        stem, suffix = os.path.splitext(name)
        if suffix.lower() in suffixes:
            name = stem
    return name


class _FieldError(Exception):
    """Fields of a line that do not fit its message type."""


class _CutShortError(_FieldError):
    """Fewer fields than the message type has."""


def _check_text(line: LogLine) -> None:
    binary = b"\0" in line.text
    if not binary and not line.text.isascii():
        try:
            line.text.decode()
        except UnicodeDecodeError:
            binary = True
    if binary:
        raise _FieldError("binary data: expected the text of a CARMEN log")
    if not line.ended:
        word = line.text.strip()
        if line.suspect or any(name.startswith(word) for name in RECORD_PARSERS):
            raise _CutShortError(f"{len(line.text)} bytes of a line without its end")


def _is_cut(line: LogLine, fields: Sequence[bytes], error: Exception) -> bool:
    """Whether a last line with an error was cut short, rather than written wrongly."""
    if isinstance(error, _CutShortError):
        return True
    return line.number > 1 and not line.ended and (line.text.endswith(b"\0") or not _is_number(fields[-1]))


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return b"_" not in field


def _shown(field: bytes) -> str:
    return repr(field[:40].decode(errors="replace"))


def _numbers(fields: Sequence[bytes], what: str) -> list[float]:
    with suppress(ValueError):
        if b"_" not in b"".join(fields):
            return list(map(float, fields))
    token = next(field for field in fields if not _is_number(field))
    raise _FieldError(f"{_shown(token)} in the {what} is no number: expected a decimal number")


def _finite(fields: Sequence[bytes], what: str) -> list[float]:
    values = _numbers(fields, what)
    for value in values:
        if not math.isfinite(value):
            raise _FieldError(f"{value:g} in the {what}: expected a finite number")
    return values


def _count(fields: Sequence[bytes], index: int, what: str, least: int) -> int:
    if index >= len(fields):
        raise _CutShortError(f"{fields[0].decode()} with {len(fields)} fields: expected {what} in field {index + 1}")
    field = fields[index]
    if not (field.isdigit() and len(field) < 10 and int(field) >= least):
        raise _FieldError(f"{what} is {_shown(field)}: expected a whole number of at least {least}")
    return int(field)


def _check_length(fields: Sequence[bytes], expected: int, what: str) -> None:
    if len(fields) != expected:
        kind = _CutShortError if len(fields) < expected else _FieldError
        raise kind(f"{fields[0].decode()}{what} with {len(fields)} fields: expected {expected}")


def _tail(fields: Sequence[bytes]) -> float:
    """Check the last three fields of a record, ipc stamp, host and logger stamp, and return the ipc stamp."""
    (stamp,) = _finite(fields[-3:-2], "ipc stamp")
    _numbers(fields[-1:], "logger stamp")
    return stamp


@lru_cache(maxsize=32)
def _flaser_angles(count: int) -> Array:
    if count % 2:
        return np.deg2rad(np.linspace(-90.0, 90.0, count))
    return np.deg2rad(-90.0 + np.arange(count) * (180.0 / count))


def _parse_flaser(fields: list[bytes]) -> Frame:
    count = _count(fields, 1, "the number of ranges", least=1)
    _check_length(fields, count + 11, f" of {count} ranges")
    ranges = np.array(_numbers(fields[2 : 2 + count], "ranges"))
    _finite(fields[-9:-6], "laser pose")
    pose_odom_robot = pose(*_finite(fields[-6:-3], "odometry pose"))
    stamp = _tail(fields)
    return Frame(stamp, pose_odom_robot, LaserScan(ranges, _flaser_angles(count).copy(), stamp))


def _parse_robotlaser(fields: list[bytes]) -> Frame:
    count = _count(fields, 8, "the number of ranges", least=1)
    remissions = _count(fields, 9 + count, "the number of remissions", least=0)
    _check_length(fields, count + remissions + 24, f" of {count} ranges and {remissions} remissions")
    start, _, resolution = _finite(fields[2:5], "beam angles")
    (range_limit,) = _numbers(fields[5:6], "maximum range")
    if not range_limit > 0.0:
        raise _FieldError(f"the maximum range is {range_limit:g}: expected more than 0 m")
    ranges = np.array(_numbers(fields[9 : 9 + count], "ranges"))
    ranges[ranges >= range_limit] = math.inf
    angles = start + np.arange(count, dtype=np.float64) * resolution
    _numbers(fields[10 + count : -14], "remissions")
    _finite(fields[-14:-11], "laser pose")
    pose_odom_robot = pose(*_finite(fields[-11:-8], "robot pose"))
    _numbers(fields[-8:-3], "velocities and safety distances")
    stamp = _tail(fields)
    return Frame(stamp, pose_odom_robot, LaserScan(ranges, angles, stamp))


def _parse_odom(fields: list[bytes]) -> Frame:
    _check_length(fields, 10, "")
    pose_odom_robot = pose(*_finite(fields[1:4], "odometry pose"))
    _numbers(fields[4:7], "velocities")
    return Frame(_tail(fields), pose_odom_robot)


def _parse_mounting(fields: list[bytes], mounting: Mounting) -> Mounting:
    """Mounting with the coordinate of a `PARAM` line; unchanged for any other line."""
    name = fields[1] if fields[0] == b"PARAM" and len(fields) > 1 else b""
    if name not in (b"robot_frontlaser_offset", b"robot_frontlaser_side_offset", b"robot_frontlaser_angular_offset"):
        return mounting
    what = f"PARAM {name.decode()}"
    if len(fields) < 3:
        raise _CutShortError(f"{what} without a value: expected a number")
    (value,) = _finite(fields[2:3], what)
    if name == b"robot_frontlaser_offset":
        return replace(mounting, x=value)
    if name == b"robot_frontlaser_side_offset":
        return replace(mounting, y=value)
    return replace(mounting, theta=value)


RECORD_PARSERS: dict[bytes, Callable[[list[bytes]], Frame]] = {
    b"FLASER": _parse_flaser,
    b"ROBOTLASER1": _parse_robotlaser,
    b"ODOM": _parse_odom,
}
