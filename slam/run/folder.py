"""The folder that a run leaves behind, and what is read back from it."""

import csv
import json
import os
import re
from collections.abc import Generator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from slam.config_file import to_toml
from slam.errors import RunFolderError
from slam.result.result import SlamResult
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import read_trajectory_file, write_tum

TRAJECTORY, TRAJECTORY_ONLINE, TRAJECTORY_ODOMETRY = (
    "trajectory.tum",
    "trajectory_online.tum",
    "trajectory_odometry.tum",
)
TRAJECTORIES = {"final": TRAJECTORY, "online": TRAJECTORY_ONLINE, "odometry": TRAJECTORY_ODOMETRY}
"""Files of the trajectories of a run by the name that the command line takes."""
LANDMARKS, METRICS, CONFIG, MAP = "landmarks.csv", "metrics.json", "config.toml", "map.png"


def default_folder(name: str, now: datetime) -> Path:
    """``runs/<log>-<date>``, the date to the second."""
    safe = re.sub(r"[^\w.-]+", "-", name)
    return Path("runs") / f"{safe}-{now:%Y-%m-%d-%H%M%S}"


@contextmanager
def claimed(folder: Path, *, overwrite: bool) -> Generator[Path]:
    """Create the folder and test that it is writable before a run; on an error remove it again if it is empty.

    Raises
    ------
    RunFolderError
        It holds something and ``overwrite`` is False, or it cannot be made or written to.
    """
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()) and not overwrite:
            raise RunFolderError(f"{folder}: is not empty; choose another --out or give --overwrite")
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be used as run folder: {error.strerror or error}") from None
    try:
        yield folder
    except BaseException:
        if made and not any(folder.iterdir()):
            folder.rmdir()
        raise


def save_run(folder: str | os.PathLike[str], result: SlamResult, title: str | None = None) -> None:
    """Write every file of a run; figures and tables first, the picture last.

    Parameters
    ----------
    folder : where to write; made if need be, files of a run that are there are replaced.
    result : what the run yielded.
    title : heading of the map; the folder's name by default.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.pictures.run_map import draw_map

    folder = Path(folder)
    config = result.config
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_tum(folder / TRAJECTORY, result.trajectory)
        write_tum(folder / TRAJECTORY_ONLINE, result.trajectory_online)
        write_tum(folder / TRAJECTORY_ODOMETRY, result.trajectory_odometry)
        (folder / LANDMARKS).write_text(result.landmarks.to_csv(), encoding="utf-8")
        (folder / CONFIG).write_text(to_toml(config), encoding="utf-8")
        metrics = json.dumps(result.metrics.to_dict(), indent=2, allow_nan=False)
        (folder / METRICS).write_text(metrics + "\n", encoding="utf-8")
        draw_map(folder / MAP, title or folder.name, result, np.random.default_rng(config.seed))
    except OSError as error:
        raise RunFolderError(f"{folder}: cannot be written: {error.strerror or error}") from None


def read_trajectory(folder: Path, which: str = "final") -> Trajectory:
    """Read a trajectory of a run, one of :data:`TRAJECTORIES`.

    Raises
    ------
    RunFolderError
        The folder is not there or holds no run.
    TrajectoryFormatError
        Its trajectory is damaged.
    """
    path = folder / TRAJECTORIES[which]
    if not folder.is_dir():
        problem = "is a file, not a run folder" if folder.exists() else "no such run folder"
        raise RunFolderError(f"{folder}: {problem}")
    if not path.is_file():
        raise RunFolderError(f"{folder}: holds no {path.name}, so it is not a run folder")
    return read_trajectory_file(path)


def read_landmarks(folder: Path) -> tuple[Array, NDArray[np.int64]]:
    """Read the landmarks of a run.

    Returns
    -------
    positions : shape (n, 2) [m].
    identities : by which the source knows each, -1 for none, shape (n,).

    Raises
    ------
    RunFolderError
        The table is not there or damaged.
    """
    path = folder / LANDMARKS
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [(float(row["x"]), float(row["y"]), int(row["identity"] or -1)) for row in csv.DictReader(file)]
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (KeyError, TypeError, ValueError):
        raise RunFolderError(f"{path}: no table of landmarks: expected columns x, y and identity of numbers") from None
    positions = np.array([(x, y) for x, y, _ in rows], np.float64).reshape(-1, 2)
    return positions, np.array([identity for _, _, identity in rows], np.int64)
