"""The whole of SLAM, frame by frame: predict, extract, register, associate, update, birth, key frame, loop."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.frame import Frame
from features.se2 import Array, Pose, compose
from slam.association import Association, ObservationCounts
from slam.conclude import conclude, landmark_map
from slam.config import SlamConfig
from slam.coupling import close_loop, merge, rebase
from slam.drifting_pose import Anchor
from slam.ekf import LandmarkEkf
from slam.front_end import FrontEnd
from slam.graph_factors import Closure
from slam.graph_journal import JournaledGraph
from slam.hypotheses import Sighting
from slam.key_frame import KeyFrame
from slam.landmark import LandmarkTable
from slam.loop_closing import LoopCloser
from slam.parts import gates, line_odometry, loop_rules
from slam.reassociation import reassociate
from slam.records import Records
from slam.result import RunMetrics, SlamResult
from slam.solution import Solution, solve
from slam.stage_clock import StageClock, peak_memory_mb
from slam.step import Step
from slam.view import View, look
from slam.watch import Trust, Watch

FIRST_POSE_COV = np.diag([1e-8, 1e-8, 1e-10])
"""The first pose defines the world frame."""


class Slam:
    """EKF-SLAM on corners, with a factor graph behind it.

    Feed frames in the order of their stamps to :meth:`process`; :meth:`finish` solves the graph and returns the result.
    The world frame is the odometry frame of the first record. Pickled and read back it goes on as if nothing had been.

    Attributes
    ----------
    config : as it was given.
    """

    def __init__(self, config: SlamConfig) -> None:
        self.config = config
        self._solution: Solution | None = None
        self._sensor = config.sensor.model()
        self._graph = JournaledGraph(config.back_end.cauchy_scale)
        self._closer = LoopCloser(loop_rules(config))
        self._front_end: FrontEnd | None = None
        self._records = Records()
        self._key_frames: list[KeyFrame] = []
        self._unidentified: list[Sighting] = []
        self._observations = ObservationCounts()
        self._watch = Watch(config.front_end.match_probability, wheels=config.odometry.source == "line-aided")
        self._clock = StageClock("extract", "odometry", "front_end", "back_end", "loop")

    @property
    def pose(self) -> Pose:
        """Pose of the robot as the filter has it, world frame, shape (3,)."""
        return compose(self._front.ekf.pose, self._since_update.motion)

    @property
    def landmarks(self) -> Array:
        """Landmarks of the filter, world frame, shape (n, 2) [m]."""
        return self._front.ekf.landmarks.copy()

    @property
    def trust(self) -> Trust:
        """Whether anything speaks against the run so far, and what."""
        return self._watch.trust

    @property
    def scans(self) -> int:
        """Scans processed so far."""
        return self._records.scans

    @property
    def stamp(self) -> float:
        """Stamp of the last frame [s]."""
        return self._records.stamps[-1]

    @property
    def filter(self) -> LandmarkEkf:
        """The filter as it is now, to look at: of the pose at the last update and the landmarks near it."""
        return self._front.ekf

    @property
    def key_frame_records(self) -> NDArray[np.int64]:
        """Number of the record of each key frame, shape (k,)."""
        return np.array([key_frame.record for key_frame in self._key_frames], np.int64)

    @property
    def closures(self) -> Sequence[Closure]:
        """Closures that entered the graph so far."""
        return self._graph.closures

    @property
    def landmark_table(self) -> LandmarkTable:
        """What is known of every landmark so far, to look at."""
        return self._front.table

    @property
    def solution(self) -> Solution:
        """Solution of the graph by the last :meth:`finish`; ValueError before it."""
        if self._solution is None:
            raise ValueError("the graph was not solved yet: call finish first")
        return self._solution

    def process(self, frame: Frame) -> Step:
        """Take one frame in.

        Raises
        ------
        DivergedError
            The filter's covariance is no longer one.
        ValueError
            The stamp is smaller than the one before, or stamp or pose is not finite; nothing has changed.
        """
        self._predict(frame.stamp, self._records.checked(frame))
        view = self._look(frame)
        if view is None:
            return Step(frame.stamp, self.pose)
        self._register(frame.stamp, view)
        association = None
        key_frame_due = self._key_frame_due(view)
        if key_frame_due or self._update_due():
            association, landmarks = self._update(view)
            if key_frame_due:
                self._add_key_frame(view, landmarks)
                self._revisit(view)
        pose = self.pose
        self._records.add_scan(pose)
        return Step(frame.stamp, pose, view.features, association)

    def _predict(self, stamp: float, pose_odom_robot: Pose) -> None:
        """Move odometry on to a record."""
        if self._front_end is None:
            self._begin(pose_odom_robot)
        self._odometry.predict(stamp, pose_odom_robot)
        self._records.add(stamp, pose_odom_robot, self._odometry.pose)

    def _begin(self, pose_odom_robot: Pose) -> None:
        """Make what begins at the first pose."""
        keep_distance = self.config.front_end.keep_distance_m
        self._front_end = FrontEnd(pose_odom_robot, FIRST_POSE_COV, gates(self.config), keep_distance)
        self._odometry = line_odometry(self.config, pose_odom_robot)
        self._since_update: Anchor = self._odometry.anchor()
        self._since_key_frame: Anchor = self._odometry.anchor()
        self._since_scan: Anchor = self._odometry.anchor()

    def _look(self, frame: Frame) -> View | None:
        if frame.scan is None and frame.observations is None:
            return None
        with self._clock.timed("extract"):
            return look(frame, self.config, self._sensor, self._records)

    def _register(self, stamp: float, view: View) -> None:
        """Correct odometry by the walls."""
        if view.scan is None or view.features is None:
            return
        odometry, records, lines = self._odometry, self._records, view.features.lines
        with self._clock.timed("odometry"):
            if self.config.odometry.source == "wheel":
                odometry.look(view.scan, lines)
            else:
                rejected = odometry.counts.predictions_rejected
                points = odometry.register(stamp, view.scan, lines)
                records.poses_map[-1] = odometry.pose
                rejected = odometry.counts.predictions_rejected > rejected
                self._watch.registered(
                    stamp, points.points, odometry.pose, records.poses_odom[-1], odometry.share, rejected=rejected
                )
            self._watch.drove(stamp, self._since_scan.motion, seen=len(lines) > 0)
            self._since_scan.reset()

    def _update_due(self) -> bool:
        front_end = self.config.front_end
        return self._since_update.beyond(front_end.update_distance_m, math.radians(front_end.update_angle_deg))

    def _key_frame_due(self, view: View) -> bool:
        if view.scan is None and self._key_frames:
            # An observation is small: the graph takes each that the filter takes, once the robot has moved at all.
            return self._update_due() and self._since_key_frame.travel + self._since_key_frame.turn > 0.0
        back_end = self.config.back_end
        return not self._key_frames or self._since_key_frame.beyond(
            back_end.key_frame_distance_m, math.radians(back_end.key_frame_angle_deg)
        )

    def _update(self, view: View) -> tuple[Association, NDArray[np.int64]]:
        """Move the filter to here, associate, update, give birth; also the landmark of each corner, -1 for none."""
        with self._clock.timed("front_end"):
            self._front.move(self._since_update.motion, self._since_update.motion_cov)
            self._since_update.reset()
            association, landmarks = self._front.observe(view.corners_robot, view.identities)
            self._observations.add(len(view.corners_robot), association)
            self._watch.updated(self._records.stamps[-1], association)
            if view.scan is not None:
                self._front.miss(view.scan, self._sensor, landmarks)
            return association, landmarks

    def _add_key_frame(self, view: View, landmarks: NDArray[np.int64]) -> None:
        """Hand the frame to the graph, and to all that goes by key frames."""
        with self._clock.timed("back_end"):
            motion, motion_cov = self._since_key_frame.motion, self._since_key_frame.motion_cov
            observations = view.observations(landmarks, 1e-3 * self.config.back_end.corner_scatter_mm)
            self._graph.add_key_frame(self._front.ekf.pose, motion, motion_cov, observations)
            if view.scan is None and view.identities is None:
                self._unidentified.append(Sighting(motion, motion_cov, view.corners_robot))
            merge(self._front, self._graph)
            self._graph.update()
            self._front.rest(len(self._key_frames), landmarks)
            if self._odometry.scan is not None:
                self._closer.add_key_frame(self._odometry.scan, view.corners_robot, motion, motion_cov)
            self._since_key_frame.reset()
            self._odometry.add_key_frame()
            self._key_frames.append(KeyFrame.of(len(self._records) - 1, view, self._sensor))

    def _revisit(self, view: View) -> None:
        """Where the newest key frame shows what was seen long ago, take the filter to where the graph has it."""
        if view.scan is None:
            if self._front.returned:
                rebase(self._front, self._graph)
        elif self.config.loop.enabled:
            with self._clock.timed("loop"):
                close_loop(self._closer, self._front, self._graph)

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
        with self._clock.timed("back_end"):
            self._solution = solution = self._solve()
        landmarks = landmark_map(solution, self.config.map.min_observations)
        metrics = self._metrics(solution, len(landmarks), interrupted)
        return conclude(self._records, self._key_frames, solution.estimate, landmarks, metrics, self.config)

    def _solve(self) -> Solution:
        """Solve the graph as it grew; where no observation has a signature or an identity, one by all that was seen.

        One that looks like any other is told apart by what is seen later, which the filter could not wait for.
        """
        graph, table, back_end = self._graph, self._front.table, self.config.back_end
        if len(self._unidentified) == len(self._key_frames):
            first_pose = graph.poses_world_robot[0]
            graph, table = reassociate(
                first_pose, FIRST_POSE_COV, self._unidentified, back_end.cauchy_scale, back_end.max_iterations
            )
        return solve(graph, table, back_end.max_iterations)

    def _metrics(self, solution: Solution, landmarks: int, interrupted: bool) -> RunMetrics:
        stamps = self._records.stamps
        duration_s, wall_s = float(stamps[-1] - stamps[0]), self._clock.elapsed
        return RunMetrics(
            scans=self.scans,
            records=len(stamps),
            duration_s=duration_s,
            wall_s=wall_s,
            times_real_time=duration_s / wall_s,
            peak_memory_mb=peak_memory_mb(),
            landmarks=landmarks,
            key_frames=len(self._key_frames),
            registrations=replace(self._odometry.counts),
            wheels=self._odometry.calibration if self.config.odometry.source == "line-aided" else None,
            observations=replace(self._observations),
            landmark_life=solution.table.counts(self.config.map.min_observations),
            closures=replace(self._closer.counts, revoked=len(solution.estimate.revoked)),
            nis=self._watch.nis,
            trust=self.trust,
            stages=self._clock.stages(),
            graph_converged=solution.estimate.converged,
            interrupted=interrupted,
        )

    @property
    def _front(self) -> FrontEnd:
        if self._front_end is None:
            raise ValueError("no frame was processed yet")
        return self._front_end
