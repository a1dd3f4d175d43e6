"""UTIAS MRCLAM data sets (Leung, Halpern, Barfoot and Liu 2011): velocities, and ranges and bearings of barcodes."""

import logging
import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers.data_sets.number_table import read_table
from drivers.errors import LogFormatError
from drivers.frame import Frame, FrameSource, LandmarkObservations, SourceInfo
from features.se2 import Array, wrap_angle

logger = logging.getLogger(__name__)

ROBOTS = 5
"""Subjects 1 to 5 are robots, which move; the others are landmarks."""

ODOMETRY = re.compile(r"Robot(\d+)_Odometry\.dat(\.gz)?")


class MrclamLog(FrameSource):
    """Measurements of one robot of a data set; its velocities are integrated to odometry.

    There is a frame for each stamp of the odometry and of the measurements. Observations of other robots are left out,
    and with a warning in the log of this package those of barcodes that the data set does not list.

    Parameters
    ----------
    path : folder of a data set of one robot, or the odometry file of one robot; all files plain or gzipped.

    Raises
    ------
    LogFormatError
        A file is missing or unusable, or the folder holds no robot or several.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        path = Path(path)
        self._folder = path if path.is_dir() else path.parent
        self._robot = _robot(path)
        self._read = 0
        subjects = {int(barcode): int(subject) for subject, barcode in self._table("Barcodes", "subject barcode")}
        self._odometry = self._robot_table("Odometry", "stamp forward_velocity angular_velocity")
        measurements = self._robot_table("Measurement", "stamp barcode range bearing")
        if not (measurements[:, 2] > 0.0).all():
            raise LogFormatError(f"{self._folder / f'Robot{self._robot}_Measurement.dat'}: a range is not positive")
        self._subjects = np.array([subjects.get(int(barcode), 0) for barcode in measurements[:, 1]])
        unknown = self._subjects == 0
        if unknown.any():
            logger.warning(
                "%s: %d observations left out, of barcodes that Barcodes.dat does not list: %s",
                self._folder,
                unknown.sum(),
                ", ".join(f"{barcode:g}" for barcode in np.unique(measurements[unknown, 1])),
            )
        landmarks = self._subjects > ROBOTS
        self._measurements, self._subjects = measurements[landmarks], self._subjects[landmarks]
        self._stamps = np.unique(np.concatenate([self._odometry[:, 0], self._measurements[:, 0]]))

    @property
    def info(self) -> SourceInfo:
        """Name of the folder with the number of the robot; the camera of the data sets, in the robot's centre."""
        return SourceInfo(f"{self._folder.resolve().name}-robot{self._robot}", "mrclam-camera")

    @property
    def progress(self) -> float:
        """Share of the frames that has been read, 0 to 1."""
        return self._read / len(self._stamps)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of their stamps; each call starts at the first."""
        poses = integrate(self._odometry, self._stamps)
        starts, ends = (
            np.searchsorted(self._measurements[:, 0], self._stamps, side=side) for side in ("left", "right")
        )
        for k, (stamp, pose_odom_robot) in enumerate(zip(self._stamps.tolist(), poses, strict=True)):
            self._read = k + 1
            here = slice(starts[k], ends[k])
            if starts[k] == ends[k]:
                yield Frame(stamp, pose_odom_robot)
                continue
            _, _, ranges, bearings = self._measurements[here].T
            observations = LandmarkObservations(ranges, bearings, identities=self._subjects[here])
            yield Frame(stamp, pose_odom_robot, observations=observations)

    def truth(self) -> tuple[Array, Array]:
        """Read the poses of the robot by motion capture.

        Returns
        -------
        stamps : shape (n,) [s].
        poses_world_robot : shape (n, 3) [m, m, rad].

        Raises
        ------
        LogFormatError
            The file is missing or unusable.
        """
        truth = self._robot_table("Groundtruth", "stamp x y orientation")
        return truth[:, 0], truth[:, 1:]

    def true_landmarks(self) -> tuple[NDArray[np.int64], Array]:
        """Read identities, shape (n,), and surveyed positions, shape (n, 2) [m], of the landmarks.

        Raises
        ------
        LogFormatError
            The file is missing or unusable.
        """
        table = self._table("Landmark_Groundtruth", "subject x y x_sigma y_sigma")
        return table[:, 0].astype(np.int64), table[:, 1:3]

    def _robot_table(self, kind: str, columns: str) -> Array:
        return self._table(f"Robot{self._robot}_{kind}", columns)

    def _table(self, name: str, columns: str) -> Array:
        plain = self._folder / f"{name}.dat"
        gzipped = self._folder / f"{name}.dat.gz"
        return read_table(plain if plain.is_file() or not gzipped.is_file() else gzipped, columns)


def is_mrclam(path: str | os.PathLike[str]) -> bool:
    """Whether a path is the odometry of a robot of a data set by its name, or a folder that holds one."""
    path = Path(path)
    return any(ODOMETRY.fullmatch(file.name) for file in (path.iterdir() if path.is_dir() else [path]))


def _robot(path: Path) -> int:
    if match := ODOMETRY.fullmatch(path.name):
        return int(match[1])
    robots = sorted({int(match[1]) for file in path.iterdir() if (match := ODOMETRY.fullmatch(file.name))})
    if len(robots) == 1:
        return robots[0]
    if not robots:
        raise LogFormatError(f"{path}: no Robot<N>_Odometry.dat in this folder: expected a log, or an MRCLAM data set")
    listed, first = ", ".join(map(str, robots)), path / f"Robot{robots[0]}_Odometry.dat"
    raise LogFormatError(f"{path} holds robots {listed}: expected the odometry file of one of them, such as {first}")


def integrate(odometry: Array, stamps: Array) -> Array:
    """Integrate velocities, each constant from its record to the next, along circular arcs.

    Parameters
    ----------
    odometry : stamp, forward velocity and turn rate of each record, shape (n, 3) [s, m/s, rad/s], in order.
    stamps : ascending, shape (k,) [s]; before the first record the robot stands still.

    Returns
    -------
    poses_odom_robot : at the stamps, shape (k, 3) [m, m, rad]; zero at the earliest time of both.
    """
    times = np.union1d(odometry[:, 0], stamps)
    current = np.searchsorted(odometry[:, 0], times[:-1], side="right") - 1
    speeds, rates = np.where(current[:, None] >= 0, odometry[current, 1:], 0.0).T
    durations = np.diff(times)
    turns = rates * durations
    headings = np.concatenate([[0.0], np.cumsum(turns)])
    # The chord of an arc: numpy's sinc is sin(pi x) / (pi x).
    chords = speeds * durations * np.sinc(turns / (2.0 * np.pi))
    directions = headings[:-1] + 0.5 * turns
    steps = np.stack([chords * np.cos(directions), chords * np.sin(directions)], axis=-1)
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    at = np.searchsorted(times, stamps)
    poses = np.column_stack([points, headings])[at]
    poses[:, 2] = wrap_angle(poses[:, 2])
    return poses
