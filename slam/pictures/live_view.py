"""The growing map on a screen, by rerun."""

import os
import sys
from pathlib import Path
from types import ModuleType

import numpy as np

from drivers.frame import Frame
from features.se2 import Array, transform
from slam.errors import ViewError
from slam.pipeline import Slam
from slam.step import Step

SIGMAS = 2.0
CIRCLE = np.column_stack([np.cos(np.linspace(0.0, 2.0 * np.pi, 25)), np.sin(np.linspace(0.0, 2.0 * np.pi, 25))])

MAP_EVERY = 10
"""Scans between two updates of landmarks and path."""

WALL, PATH, POINT, LANDMARK = (59, 69, 84), (31, 119, 180), (138, 148, 163), (209, 73, 91)


class LiveView:
    """Shows each scan where the robot has it, the walls seen so far, the path and the landmarks with 2-sigma ellipses.

    Parameters
    ----------
    title : of the window.
    slam : that the map is of.
    file : where the pictures go, to be shown with ``rerun FILE``; None for a window, or for a page that a browser
        shows where this computer has no screen.

    Raises
    ------
    ViewError
        rerun is not installed, or the file cannot be written.
    """

    def __init__(self, title: str, slam: Slam, file: Path | None = None) -> None:
        self._rerun = rerun = _rerun()
        self._slam = slam
        self._path: list[Array] = []
        self._walls: list[Array] = []
        self._key_frames = 0
        self._record = rerun.RecordingStream(f"cwlf-slam {title}")
        if file is not None:
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.touch()
            except OSError as error:
                raise ViewError(f"{file}: cannot be written: {error.strerror or error}") from None
            self._record.save(file)
        elif has_screen():
            self._record.spawn()
        else:
            rerun.serve_web_viewer(connect_to=self._record.serve_grpc(), open_browser=False)
        self._record.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)

    def close(self) -> None:
        """Hand over all that was shown."""
        self._record.flush()
        self._record.disconnect()

    def show(self, frame: Frame, step: Step) -> None:
        """Show what a frame has changed."""
        if frame.scan is None or step.features is None:
            return
        rerun, record, slam = self._rerun, self._record, self._slam
        record.set_time("stamp", timestamp=frame.stamp)
        pose = step.pose_world_robot
        mounting = slam.config.sensor.model().mounting
        self._path.append(pose[:2])
        seen = np.isfinite(frame.scan.ranges) & (frame.scan.ranges > 0.0)
        ranges, angles = frame.scan.ranges[seen], frame.scan.angles[seen]
        points = mounting.points_to_robot(np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)]))
        record.log("scan", rerun.Points2D(transform(pose, points), colors=POINT, radii=0.02))
        heading = np.array([np.cos(pose[2]), np.sin(pose[2])])
        record.log("robot", rerun.Arrows2D(origins=pose[:2], vectors=0.4 * heading, colors=PATH))
        if len(slam.key_frame_records) > self._key_frames:
            self._key_frames = len(slam.key_frame_records)
            walls = transform(pose, mounting.points_to_robot(step.features.lines.ends))
            record.log(f"walls/{self._key_frames}", rerun.LineStrips2D(walls, colors=WALL, radii=0.01))
        if len(self._path) % MAP_EVERY == 1:
            record.log("path", rerun.LineStrips2D([np.array(self._path)], colors=PATH, radii=0.015))
            ekf = slam.filter
            rings = [position + ring(cov) for position, cov in zip(ekf.landmarks, ekf.landmark_covs, strict=True)]
            record.log("landmarks", rerun.Points2D(ekf.landmarks, colors=LANDMARK, radii=0.05))
            record.log("landmarks/uncertainty", rerun.LineStrips2D(rings, colors=LANDMARK, radii=0.005))


def ring(cov: Array) -> Array:
    """2-sigma ellipse of a covariance, shape (2, 2), about the origin, shape (n, 2)."""
    values, vectors = np.linalg.eigh(cov)
    return SIGMAS * (CIRCLE * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def has_screen() -> bool:
    """Whether windows can be opened here."""
    return sys.platform in {"win32", "darwin"} or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _rerun() -> ModuleType:
    try:
        import rerun
    except ImportError:
        raise ViewError("the view needs rerun: pip install rerun-sdk") from None
    return rerun
