"""Trajectories as text files: the TUM format, in which they are kept, and tables of planar poses."""

import math
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from features.errors import CwlfError
from features.se2 import wrap_angle
from slam.result.trajectory import Trajectory

TUM = "stamp x y z qx qy qz qw"
PLANAR = "stamp x y theta"


class TrajectoryFormatError(CwlfError):
    """A trajectory file that cannot be read; the message names the file, the line and what was expected."""


def write_tum(path: str | os.PathLike[str], trajectory: Trajectory) -> None:
    """Write a trajectory as lines `stamp x y z qx qy qz qw`, stamps to 1e-6 s and the others to 1e-9.

    Parameters
    ----------
    path : file to write; an existing one is replaced.
    trajectory : the same one gives the same bytes.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    lines = (
        f"{stamp:.6f} {x:.9f} {y:.9f} 0 0 0 {math.sin(theta / 2.0):.9f} {math.cos(theta / 2.0):.9f}\n"
        for stamp, (x, y, theta) in zip(trajectory.stamps.tolist(), trajectory.poses.tolist(), strict=True)
    )
    Path(path).write_bytes("".join(lines).encode("ascii"))


def read_trajectory_file(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory, lines `stamp x y z qx qy qz qw` (TUM) or `stamp x y theta` [s, m, m, rad].

    Of a pose in space, x, y and the yaw are kept: that of roll, pitch, yaw, the direction of the rotated x axis seen
    from above.

    Parameters
    ----------
    path : file to read; blank lines and those that begin with `#` are skipped.

    Raises
    ------
    TrajectoryFormatError
        The file cannot be read or has no pose, a line has not as many finite numbers as the first, a quaternion is
        zero, or a stamp is smaller than the one before.
    """
    stamps: list[float] = []
    poses: list[tuple[float, float, float]] = []
    for number, values in read_rows(path, (TUM, PLANAR), TrajectoryFormatError):
        stamp, x, y, *rest = values
        if stamps and stamp < stamps[-1]:
            raise TrajectoryFormatError(
                f"{path}, line {number}: stamp goes back by {stamps[-1] - stamp:.6f} s: expected stamps in order"
            )
        if len(rest) == 1:
            theta = wrap_angle(rest[0])
        else:
            _, *quaternion = rest
            if math.hypot(*quaternion) < 1e-6:
                raise TrajectoryFormatError(f"{path}, line {number}: quaternion is zero: expected one of length 1")
            theta = _yaw(*quaternion)
        stamps.append(stamp)
        poses.append((x, y, theta))
    if not stamps:
        raise TrajectoryFormatError(f"{path} has no pose: expected lines of `{TUM}` or `{PLANAR}`")
    return Trajectory(np.array(stamps), np.array(poses))


def _yaw(qx: float, qy: float, qz: float, qw: float) -> float:
    return wrap_angle(math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz))


def read_rows(
    path: str | os.PathLike[str], forms: Sequence[str], error_type: type[CwlfError]
) -> Iterator[tuple[int, list[float]]]:
    """Yield line number and finite values of each line of a table of numbers in a text file.

    Parameters
    ----------
    path : file to read; blank lines and those that begin with `#` are skipped.
    forms : names of the columns, separated by blanks, of each form that the table may have, all of different lengths;
        the first line chooses the form.
    error_type : what to raise; the message names file, line, cause and the columns that were expected.
    """
    expected = " or ".join(f"`{form}`" for form in forms)
    try:
        lines = Path(path).read_text(encoding="utf-8").split("\n")
    except UnicodeDecodeError:
        raise error_type(f"{path} is not text: expected lines of {expected}") from None
    except OSError as error:
        raise error_type(f"{path} cannot be read ({error.strerror}): expected lines of {expected}") from error
    form = None
    for number, line in enumerate(lines, start=1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if form is None:
            form = next((each for each in forms if len(each.split()) == len(fields)), None)
            expected = expected if form is None else f"`{form}`"
        if form is None or len(fields) != len(form.split()):
            raise error_type(f"{path}, line {number}: {len(fields)} fields: expected {expected}")
        for field in fields:
            if not _is_finite_number(field):
                raise error_type(f"{path}, line {number}: {field[:40]!r} is no finite number: expected {expected}")
        yield number, list(map(float, fields))


def _is_finite_number(field: str) -> bool:
    try:
        return math.isfinite(float(field)) and "_" not in field
    except ValueError:
        return False
