"""Compiled code is loaded, or made at the very first use on a machine, before the clock of a run starts."""

import logging
from contextlib import AbstractContextManager

import numpy as np
from numba.core.event import Event, Listener, install_listener

from features.extract import extract
from features.scan import LaserScan
from features.se2 import pose
from slam.config import SlamConfig
from slam.filter.front_end import FrontEnd
from slam.odometry.beams import beyond_walls
from slam.parts import gates, line_odometry

logger = logging.getLogger(__name__)


def load_compiled(config: SlamConfig) -> None:
    """Call each kernel once; where one has to be compiled first, say so."""
    with announced():
        _call_kernels(config)


def announced() -> AbstractContextManager[None]:
    """Say so where something that is called within has to be compiled first."""
    return install_listener("numba:compile", Notice())


class Notice(Listener):
    """Says once, before the first function is compiled, that this takes its time."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: Event) -> None:
        """Hear that a function is about to be compiled; one that is loaded is not heard of."""
        if not self._said:
            self._said = True
            logger.info("compiling for this computer, once: that takes about a minute")

    def on_end(self, event: Event) -> None:
        """Hear that it is compiled."""


def _call_kernels(config: SlamConfig) -> None:
    """Send two scans of the corner of a room through odometry and front end."""
    sensor = config.sensor.model()
    angles = np.linspace(0.0, np.pi / 2.0, 90)
    scan = LaserScan(2.0 / np.maximum(np.cos(angles), np.sin(angles)), angles)
    features = extract(scan, sensor, config.extraction)
    odometry = line_odometry(config, pose())
    front_end = FrontEnd(pose(), 1e-4 * np.eye(3), gates(config), config.front_end.keep_distance_m)
    since = odometry.anchor()
    for step in range(2):
        odometry.predict(float(step), pose(0.2 * step))
        points = odometry.register(float(step), scan, features.lines)
        beyond_walls(points, points.walls_robot, pose())
        odometry.add_key_frame()
        front_end.move(since.motion, since.motion_cov)
        _, landmarks = front_end.observe(features.corners.to_robot(sensor.mounting))
        front_end.miss(scan, sensor, landmarks)
        front_end.merge()
