"""The whole of SLAM, frame by frame: predict, extract, register, associate, update, birth, key frame."""

import logging
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from drivers.frame import Frame
from features.extract import extract
from features.feature import Corners, Features
from features.scan import LaserScan
from features.se2 import Array, Pose, compose, rotation, transform
from slam.association import Association
from slam.config import SlamConfig
from slam.deskew import deskew_by_odometry
from slam.errors import DivergedError
from slam.front_end import FrontEnd
from slam.graph import GraphEstimate, LandmarkGraph, Observations
from slam.landmark import GONE
from slam.line_odometry import load_compiled
from slam.loop_closing import LoopCloser
from slam.parts import gates, line_odometry, loop_rules
from slam.result import LandmarkMap, RunMetrics, SlamResult, StageTime
from slam.smoothing import carry_corrections
from slam.trajectory import Trajectory

logger = logging.getLogger(__name__)

FIRST_POSE_COV = np.diag([1e-8, 1e-8, 1e-10])
"""The first pose defines the world frame."""


STAGES = ("extract", "odometry", "front_end", "back_end", "loop")


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What one frame did.

    Parameters
    ----------
    stamp : of the frame [s].
    pose_world_robot : pose of the filter after the frame, shape (3,).
    features : lines and corners of its scan, sensor frame; None for a frame without scan.
    association : what became of the corners; None where the robot had not moved enough to use them.
    """

    stamp: float
    pose_world_robot: Pose
    features: Features | None = None
    association: Association | None = None


@dataclass(frozen=True, slots=True, eq=False)
class KeyFrame:
    """A frame that the graph holds: its record number and what its scan shows, robot frame."""

    record: int
    walls_robot: Array
    points_robot: Array


class Slam:
    """EKF-SLAM on corners, with a factor graph behind it.

    Feed frames in the order of their stamps to :meth:`process`; :meth:`finish` solves the graph and returns the result.
    The world frame is the odometry frame of the first record.
    """

    def __init__(self, config: SlamConfig) -> None:
        self.config = config
        self._sensor = config.sensor.model()
        self._graph = LandmarkGraph(config.back_end.cauchy_scale)
        self._closer = LoopCloser(loop_rules(config))
        self._front_end: FrontEnd | None = None
        self._key_frames: list[KeyFrame] = []
        self._stamps: list[float] = []
        self._poses_odom: list[Pose] = []
        self._poses_map: list[Pose] = []
        self._online: list[tuple[float, Pose]] = []
        self._stages: dict[str, list[float]] = {
            "extract": [],
            "odometry": [],
            "front_end": [],
            "back_end": [],
            "loop": [],
        }
        # Compiled code is loaded, or made at the very first use on a machine, before the clock starts.
        scan = LaserScan(np.ones(8), np.linspace(0.0, 0.1, 8))
        load_compiled(scan, extract(scan, self._sensor, config.extraction).lines, self._sensor)
        self._started = time.perf_counter()

    @property
    def pose(self) -> Pose:
        """Pose of the robot as the filter has it, world frame, shape (3,)."""
        return compose(self._front.ekf.pose, self._since_update.motion)

    @property
    def landmarks(self) -> Array:
        """Landmarks of the filter, world frame, shape (n, 2) [m]."""
        return self._front.ekf.landmarks.copy()

    @property
    def scans(self) -> int:
        """Scans processed so far."""
        return len(self._online)

    def process(self, frame: Frame) -> Step:
        """Take one frame in.

        Raises
        ------
        DivergedError
            The filter's covariance is no longer one.
        ValueError
            The stamp is smaller than the one before, or stamp or pose is not finite; nothing has changed.
        """
        self._predict(frame.stamp, self._checked(frame))
        if frame.scan is None:
            return Step(frame.stamp, self.pose)
        scan = frame.scan
        with self._timed("extract"):
            if self.config.front_end.deskew:
                scan = deskew_by_odometry(scan, self._sensor, self._stamps, self._poses_odom)
            features = extract(scan, self._sensor, self.config.extraction)
            corners_robot = features.corners.to_robot(self._sensor.mounting)
        if self.config.odometry.source != "wheel":
            with self._timed("odometry"):
                self._odometry.register(frame.stamp, scan, features.lines)
                self._poses_map[-1] = self._odometry.pose
        association = None
        key_frame_due = self._key_frame_due()
        if key_frame_due or self._update_due():
            with self._timed("front_end"):
                association, landmarks = self._update(scan, corners_robot)
            if key_frame_due:
                with self._timed("back_end"):
                    self._add_key_frame(scan, features, corners_robot, landmarks)
                if self.config.loop.enabled:
                    with self._timed("loop"):
                        self._close_loop()
        self._online.append((frame.stamp, self.pose))
        return Step(frame.stamp, self.pose, features, association)

    def _checked(self, frame: Frame) -> Pose:
        """Odometry pose of a frame that may follow those before; a copy, as the caller may write to its own."""
        pose_odom_robot = np.array(frame.pose_odom_robot, dtype=np.float64)
        if pose_odom_robot.shape != (3,):
            raise ValueError(f"odometry pose of shape {pose_odom_robot.shape}: expected [x, y, theta] of shape (3,)")
        if not (math.isfinite(frame.stamp) and np.isfinite(pose_odom_robot).all()):
            raise ValueError(f"stamp {frame.stamp} or odometry pose {pose_odom_robot} is not finite")
        if self._stamps and frame.stamp < self._stamps[-1]:
            raise ValueError(
                f"stamp {frame.stamp} is smaller than {self._stamps[-1]} before it: expected frames in order"
            )
        return pose_odom_robot

    def _predict(self, stamp: float, pose_odom_robot: Pose) -> None:
        if self._front_end is None:
            keep_distance = self.config.front_end.keep_distance_m
            self._front_end = FrontEnd(pose_odom_robot, FIRST_POSE_COV, gates(self.config), keep_distance)
            self._odometry = line_odometry(self.config, pose_odom_robot)
            self._since_update = self._odometry.anchor()
            self._since_key_frame = self._odometry.anchor()
        self._odometry.predict(stamp, pose_odom_robot)
        self._stamps.append(stamp)
        self._poses_odom.append(pose_odom_robot)
        self._poses_map.append(self._odometry.pose)

    def _update_due(self) -> bool:
        front_end = self.config.front_end
        since = self._since_update
        return since.travel >= front_end.update_distance_m or since.turn >= math.radians(front_end.update_angle_deg)

    def _key_frame_due(self) -> bool:
        back_end = self.config.back_end
        since = self._since_key_frame
        return (
            not self._key_frames
            or since.travel >= back_end.key_frame_distance_m
            or since.turn >= math.radians(back_end.key_frame_angle_deg)
        )

    def _update(self, scan: LaserScan, corners_robot: Corners) -> tuple[Association, np.ndarray]:
        """Move the filter to here, associate, update, give birth; also the landmark of each corner, -1 for none."""
        self._front.move(self._since_update.motion, self._since_update.motion_cov)
        self._since_update.reset()
        association, landmarks = self._front.observe(corners_robot)
        self._front.miss(scan, self._sensor, landmarks)
        return association, landmarks

    def _add_key_frame(
        self, scan: LaserScan, features: Features, corners_robot: Corners, landmarks: np.ndarray
    ) -> None:
        observed = landmarks >= 0
        self._graph.add_key_frame(
            self._front.ekf.pose,
            self._since_key_frame.motion,
            self._since_key_frame.motion_cov,
            Observations(landmarks[observed], corners_robot.positions[observed], corners_robot.covs[observed]),
        )
        for kept, other in self._front.merge():
            self._graph.merge(kept, other)
        self._graph.update()
        self._front.rest(len(self._key_frames), landmarks)
        if self._odometry.scan is not None:
            self._closer.add_key_frame(self._odometry.scan, self._since_key_frame.travel)
        self._since_key_frame.reset()
        self._odometry.add_key_frame()
        mounting = self._sensor.mounting
        seen = (scan.ranges > 0.0) & (scan.ranges >= self._sensor.range_min) & (scan.ranges <= self._sensor.range_max)
        ranges, angles = scan.ranges[seen], scan.angles[seen]
        points_sensor = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)
        self._key_frames.append(
            KeyFrame(
                record=len(self._stamps) - 1,
                walls_robot=mounting.points_to_robot(features.lines.ends),
                points_robot=mounting.points_to_robot(points_sensor),
            )
        )

    def _close_loop(self) -> None:
        """Look for a place seen before; where it is found the graph moves, and the filter with it."""
        closure = self._closer.find(self._graph.poses_world_robot)
        if closure is None:
            return
        self._graph.add_closure(closure)
        self._graph.update()
        poses = self._graph.poses_world_robot
        cov = self._graph.newest_cov()
        if cov is None:
            return
        self._front.rebase(poses[-1], cov)
        turn = np.eye(3)
        turn[:2, :2] = rotation(poses[closure.older, 2])
        self._front.wake(poses, self._closer.passage(closure.older), turn @ closure.cov @ turn.T)
        for kept, other in self._front.merge():
            self._graph.merge(kept, other)

    def finish(self, *, interrupted: bool = False) -> SlamResult:
        """Solve the graph and put the result together; ``interrupted`` is noted in the metrics.

        Where the graph has no unique solution the filter's poses and landmarks stand, and a warning says so.

        Raises
        ------
        ValueError
            No scan was processed.
        """
        if not self._key_frames:
            raise ValueError("no scan was processed: there is nothing to finish")
        with self._timed("back_end"):
            estimate = self._solve()
        stamps, poses_map = np.array(self._stamps), np.array(self._poses_map)
        anchors = np.array([key_frame.record for key_frame in self._key_frames])
        table = self._front.table
        kept = (table.observations[estimate.landmarks] >= self.config.map.min_observations) & (
            table.key_frames[estimate.landmarks] != GONE
        )
        ids = estimate.landmarks[kept]
        placed = list(zip(estimate.poses_world_robot, self._key_frames, strict=True))
        wall_s = time.perf_counter() - self._started
        duration_s = float(stamps[-1] - stamps[0])
        return SlamResult(
            trajectory=Trajectory(stamps, carry_corrections(poses_map, anchors, estimate.poses_world_robot)),
            trajectory_online=Trajectory(
                np.array([stamp for stamp, _ in self._online]), np.array([pose for _, pose in self._online])
            ),
            trajectory_odometry=Trajectory(stamps, poses_map),
            wheel_odometry=Trajectory(stamps, np.array(self._poses_odom)),
            landmarks=LandmarkMap(
                ids=ids,
                positions=estimate.positions_world[kept],
                covs=estimate.covs[kept],
                observations=table.observations[ids],
                convex=table.convex[ids],
                opening_angles=table.opening_angles[ids],
            ),
            walls=np.concatenate([transform(pose, key_frame.walls_robot) for pose, key_frame in placed]),
            points=np.concatenate([transform(pose, key_frame.points_robot) for pose, key_frame in placed]),
            metrics=RunMetrics(
                scans=self.scans,
                records=len(stamps),
                duration_s=duration_s,
                wall_s=wall_s,
                times_real_time=duration_s / wall_s,
                peak_memory_mb=peak_memory_mb(),
                landmarks=len(ids),
                key_frames=len(self._key_frames),
                registrations=self._odometry.counts,
                stages={name: StageTime.of(seconds) for name, seconds in self._stages.items()},
                graph_converged=estimate.converged,
                interrupted=interrupted,
            ),
            config=self.config,
        )

    def _solve(self) -> GraphEstimate:
        try:
            return self._graph.optimize(self.config.back_end.max_iterations)
        except DivergedError as error:
            logger.warning("%s: the result is what was known on the way", error)
            return self._graph.unsolved()

    @property
    def _front(self) -> FrontEnd:
        if self._front_end is None:
            raise ValueError("no frame was processed yet")
        return self._front_end

    @contextmanager
    def _timed(self, stage: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self._stages[stage].append(time.perf_counter() - start)


def peak_memory_mb() -> float | None:
    """Largest resident memory of this process so far [MB]; None where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)
