"""Wheel odometry that another program writes line by line."""

import logging
import math
import sys
from collections import deque
from pathlib import Path
from threading import Condition, Thread

import numpy as np

from drivers.errors import DriverError
from features.se2 import Pose, wrap_angle

logger = logging.getLogger(__name__)

KEPT = 10_000
"""Number of poses that are kept: 100 s at 100 Hz."""

PATIENCE = 0.1
"""Longest wait for a pose at or after a stamp [s]."""

FIRST_PATIENCE = 10.0
"""Longest wait for the first pose [s]."""

SILENCE = 1.0
"""Time without poses after which a warning is logged [s]."""


class OdometryStream:
    """Poses of the wheels, lines ``stamp x y theta`` [s since 1970, m, m, rad], as another program writes them.

    A thread reads the lines. One that is not of four finite numbers, or whose stamp goes back, is left out with a
    warning.

    Parameters
    ----------
    path : a FIFO, a file or a device; ``-`` for the standard input.

    Raises
    ------
    DriverError
        It cannot be opened.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._poses: deque[tuple[float, float, float, float]] = deque(maxlen=KEPT)
        self._changed = Condition()
        self._ended = self._silent = False
        if path != "-" and not Path(path).exists():
            raise DriverError(f"{path}: no such file: expected one that odometry is written to, such as a FIFO")
        Thread(target=self._read, name="odometry", daemon=True).start()

    def at(self, stamp: float) -> Pose:
        """Interpolate the pose at a stamp, shape (3,) [m, m, rad]; the newest pose where none after it comes in time.

        Raises
        ------
        DriverError
            No pose has come yet.
        """
        with self._changed:
            if not self._poses:
                self._changed.wait_for(lambda: self._poses or self._ended, FIRST_PATIENCE)
            if not self._poses:
                raise DriverError(f"{self._path}: no odometry came: expected lines of `stamp x y theta`")
            patience = 0.0 if self._silent else PATIENCE
            self._changed.wait_for(lambda: self._ended or self._poses[-1][0] >= stamp, patience)
            poses = self._poses
            late = stamp - poses[-1][0]
            if self._silent is not (late > SILENCE):
                self._silent = not self._silent
                logger.warning(
                    "%s: %s", self._path, f"no odometry for {late:.1f} s" if self._silent else "odometry is there again"
                )
            index = next((k for k in range(len(poses) - 1, -1, -1) if poses[k][0] <= stamp), 0)
            before, after = np.array(poses[index]), np.array(poses[min(index + 1, len(poses) - 1)])
        span = after[0] - before[0]
        share = min(max((stamp - before[0]) / span, 0.0), 1.0) if span > 0.0 else 0.0
        change = after[1:] - before[1:]
        change[2] = wrap_angle(float(change[2]))
        pose = before[1:] + share * change
        pose[2] = wrap_angle(float(pose[2]))
        return pose

    def _read(self) -> None:
        try:
            with sys.stdin if self._path == "-" else Path(self._path).open(encoding="ascii", errors="replace") as file:
                for number, line in enumerate(file, start=1):
                    self._take(number, line)
        except (OSError, ValueError) as error:
            logger.warning("%s cannot be read: %s", self._path, error)
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _take(self, number: int, line: str) -> None:
        try:
            stamp, x, y, theta = map(float, line.split())
        except ValueError:
            stamp = x = y = theta = math.nan
        with self._changed:
            if not all(map(math.isfinite, (stamp, x, y, theta))):
                logger.warning("%s, line %d: left out: expected `stamp x y theta`", self._path, number)
            elif self._poses and stamp < self._poses[-1][0]:
                logger.warning("%s, line %d: left out: its stamp goes back", self._path, number)
            else:
                self._poses.append((stamp, x, y, theta))
                self._changed.notify_all()
