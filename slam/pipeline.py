"""The whole of SLAM, frame by frame: predict, extract, register, associate, update, birth, key frame, loop."""

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drivers.frame import Frame
from features.noise.gauge import NoiseGauge
from features.scan import LaserScan
from features.se2 import Array, Pose, compose
from slam.config import SlamConfig
from slam.coupling import close_loop, merge, rebase
from slam.errors import ConfigError
from slam.filter.association import Association, Associator, ObservationCounts
from slam.filter.ekf import LandmarkEkf
from slam.filter.landmark_table import LandmarkTable
from slam.graph.back_end import BackEnd
from slam.graph.journal import JournaledGraph
from slam.graph.multi_hypothesis import Sighting
from slam.graph.reassociation import reassociate
from slam.graph.solution import Solution, solve
from slam.graph.values import Closure
from slam.key_frame import KeyFrame
from slam.map.landmark_map import landmark_map
from slam.odometry.deskew import Sweep, deskew
from slam.parts import FIRST_POSE_COV, CwlfExtractor, Estimators, loop_closer, trust_monitor
from slam.result.assemble import assemble_result
from slam.result.records import Records
from slam.result.result import SlamResult
from slam.result.run_metrics import RunMetrics
from slam.result.stage_clock import StageClock, peak_memory_mb
from slam.rules import SlamRules
from slam.step import Step
from slam.trust.monitor import Trust
from slam.view import Extractor, View, view_of_observations, view_of_scan


class Slam:
    """EKF-SLAM on corners, with a factor graph behind it.

    Feed frames in the order of their stamps to :meth:`process`; :meth:`finish` solves the graph and returns the result.
    The world frame is the odometry frame of the first record. A pickled object continues, once it is read back, as the
    original would.

    Parameters
    ----------
    config : of all that comes with the project: what depends on the robot, the scanner or the building.
    rules : the numbers of the method itself, for a study of them.
    extractor : another extractor of features than :func:`features.extraction.extract`.
    associator : another association of corners and landmarks than :func:`slam.filter.association.associate`.
    back_end : makes another back-end, without key frames, than :class:`slam.graph.incremental.LandmarkGraph`.

    Attributes
    ----------
    config : as it was given.
    """

    def __init__(
        self,
        config: SlamConfig,
        *,
        rules: SlamRules = SlamRules(),  # noqa: B008, frozen
        extractor: Extractor | None = None,
        associator: Associator | None = None,
        back_end: Callable[[], BackEnd] | None = None,
    ) -> None:
        self.config = config
        self._rules = rules
        self._solution: Solution | None = None
        self._extractor: Extractor = extractor or CwlfExtractor(config.extraction)
        self._associator = associator
        self._back_end = back_end
        use = config.sensor.noise == "measured"
        whole_walls = extractor or CwlfExtractor(config.extraction).of_whole_walls()
        self._gauge = NoiseGauge(config.sensor.model(), whole_walls, use=use, rules=rules.noise)
        self._held: list[Frame] = []
        self._clock = StageClock("extract", "odometry", "front_end", "back_end", "loop")
        self._begin()

    def _begin(self) -> None:
        """Begin with the sensor as it is known now, without any frame."""
        config, rules = self.config, self._rules
        self._sensor = self._gauge.sensor
        self._graph = self._new_graph()
        self._closer = loop_closer(config, rules)
        self._started: Estimators | None = None
        self._records = Records(has_odometry=config.odometry.source != "lines")
        self._key_frames: list[KeyFrame] = []
        self._unidentified: list[Sighting] = []
        self._observations = ObservationCounts()
        self._monitor = trust_monitor(config, rules)

    @property
    def pose(self) -> Pose:
        """Pose of the robot as the filter has it, world frame, shape (3,)."""
        estimators = self._estimators
        return compose(estimators.front_end.ekf.pose, estimators.since_update.motion)

    @property
    def landmarks(self) -> Array:
        """Landmarks of the filter, world frame, shape (n, 2) [m]."""
        return self._estimators.front_end.ekf.landmarks.copy()

    @property
    def trust(self) -> Trust:
        """Whether there is a reason not to trust the run so far, and which."""
        return self._monitor.trust

    @property
    def scans(self) -> int:
        """Scans processed so far."""
        return len(self._records.scans)

    @property
    def stamp(self) -> float:
        """Stamp of the last frame [s]."""
        return self._records.stamps[-1]

    @property
    def filter(self) -> LandmarkEkf:
        """The filter, for reading: the pose at the last update and the active landmarks."""
        return self._estimators.front_end.ekf

    @property
    def key_frame_records(self) -> NDArray[np.int64]:
        """Number of the record of each key frame, shape (k,)."""
        scans = self._records.scans
        return np.array([scans[key_frame.scan].record for key_frame in self._key_frames], np.int64)

    @property
    def key_frame_stamps(self) -> Array:
        """When the robot was at each key frame, shape (k,) [s]."""
        scans = self._records.scans
        return np.array([scans[key_frame.scan].stamp for key_frame in self._key_frames])

    @property
    def closures(self) -> Sequence[Closure]:
        """Closures that entered the graph so far."""
        return self._graph.closures

    @property
    def landmark_table(self) -> LandmarkTable:
        """Everything that is known of each landmark so far, for reading."""
        return self._estimators.front_end.table

    @property
    def solution(self) -> Solution:
        """Solution of the graph by the last :meth:`finish`; ValueError before it."""
        if self._solution is None:
            raise ValueError("the graph was not solved yet: call finish first")
        return self._solution

    def process(self, frame: Frame) -> Step:
        """Process one frame.

        The frame at which the noise of the sensor becomes known has all before it processed anew with this noise.

        Raises
        ------
        DivergedError
            The estimate is not finite, or its covariance is not positive definite.
        ValueError
            The stamp is smaller than the one before, or stamp or pose is not finite; nothing has changed.
        """
        step = self._process(frame)
        if self._gauge.ready:
            return step
        # What a caller writes into its arrays afterwards does not count.
        self._held.append(deepcopy(frame))
        if frame.observations is not None:
            self._gauge.leave()
        again = frame.scan is not None and self._gauge.see(frame.scan)
        return self._process_anew() if again else self._release(step)

    def _process_anew(self) -> Step:
        """Process all frames so far again, with what is known of the sensor now."""
        self._begin()
        *before, step = [self._process(frame) for frame in self._held]
        return self._release(replace(step, before=tuple(before)))

    def _release(self, step: Step) -> Step:
        """Let go of the frames that were held, once nothing more is to be measured on them."""
        if self._gauge.ready:
            self._held.clear()
        return step

    def _process(self, frame: Frame) -> Step:
        self._predict(frame.stamp, self._records.checked(frame))
        if frame.scan is not None:
            self._estimators.odometry.look_for_stand(frame.scan)
        sweep = self._sweep(frame.scan)
        view = self._extract(frame, sweep)
        if view is None:
            return Step(frame.stamp, self.pose)
        stamp, pose_odom = frame.stamp, self._records.poses_odom[-1]
        if sweep is not None:
            stamp, pose_odom = sweep.stamp, sweep.pose_odom
            self._estimators.odometry.move_to(sweep)
        self._register(stamp, pose_odom, view, sweep)
        association = None
        key_frame_due = self._key_frame_due(view)
        if key_frame_due or self._update_due():
            association, landmarks = self._update(view)
            if key_frame_due:
                self._add_key_frame(view, landmarks)
                self._close_loop(view)
        pose = self.pose
        odometry = self._estimators.odometry
        self._records.add_scan(stamp, pose_odom, odometry.pose.copy(), pose)
        if odometry.stand_found:
            self._records.stood(odometry.stand_found)
        cov = None if association is None else self.filter.pose_cov
        return Step(stamp, pose, view.features, association, cov)

    def _predict(self, stamp: float, pose_odom_robot: Pose) -> None:
        """Move odometry on to a record; the first one starts the estimators."""
        if self._started is None:
            self._started = Estimators.start(self.config, self._rules, pose_odom_robot, self._associator, self._sensor)
        odometry = self._started.odometry
        odometry.predict(stamp, pose_odom_robot)
        self._records.add(stamp, odometry.pose_odom, odometry.pose)

    def _sweep(self, scan: LaserScan | None) -> Sweep | None:
        """Motion during a scan; None where it is not to be undone, or the beams have no times."""
        if scan is None or not self.config.front_end.deskew:
            return None
        return self._estimators.odometry.sweep(scan, self._records.stamps, self._records.poses_odom)

    def _extract(self, frame: Frame, sweep: Sweep | None) -> View | None:
        """Return what a frame shows; None for a record of odometry only."""
        config = self.config
        if frame.observations is not None:
            if config.odometry.source == "lines":
                raise ConfigError(
                    "odometry.source is 'lines', but the source has no scans: expected 'line-aided' or 'wheel'"
                )
            with self._clock.timed("extract"):
                use_identities = config.front_end.use_identities
                return view_of_observations(frame.observations, self._sensor, use_identities=use_identities)
        if frame.scan is None:
            return None
        with self._clock.timed("extract"):
            scan = frame.scan if sweep is None else deskew(frame.scan, self._sensor, sweep)
            if (sigma := self._gauge.watch(scan)) is not None:
                self._monitor.scattered(frame.stamp, sigma, self._sensor.sigma_range)
            return view_of_scan(scan, self._sensor, self._extractor, sweep)

    def _register(self, stamp: float, pose_odom: Pose, view: View, sweep: Sweep | None) -> None:
        """Correct odometry by the walls."""
        if view.scan is None or view.features is None:
            return
        estimators, lines = self._estimators, view.features.lines
        odometry = estimators.odometry
        with self._clock.timed("odometry"):
            if self.config.odometry.source == "wheel":
                odometry.set_scan(view.scan, lines, sweep)
            else:
                rejected = odometry.counts.predictions_rejected
                points = odometry.register(stamp, view.scan, lines, sweep)
                rejected = odometry.counts.predictions_rejected > rejected
                self._monitor.registered(
                    stamp, points.points, odometry.pose, pose_odom, odometry.share, rejected=rejected
                )
            if odometry.jumped:
                self._monitor.jumped(stamp, odometry.share)
            self._monitor.drove(stamp, estimators.since_scan.motion, seen=len(lines) > 0)
            estimators.since_scan.reset()

    def _update_due(self) -> bool:
        front_end = self.config.front_end
        since = self._estimators.since_update
        return since.moved_beyond(front_end.update_distance_m, math.radians(front_end.update_angle_deg))

    def _key_frame_due(self, view: View) -> bool:
        since = self._estimators.since_key_frame
        if view.scan is None and self._key_frames:
            # Without scans key frames are cheap: each update of the filter makes one, once the robot has moved at all.
            return self._update_due() and since.travel + since.turn > 0.0
        back_end = self.config.back_end
        return not self._key_frames or since.moved_beyond(
            back_end.key_frame_distance_m, math.radians(back_end.key_frame_angle_deg)
        )

    def _update(self, view: View) -> tuple[Association, NDArray[np.int64]]:
        """Predict, associate, update and add new landmarks; also the landmark of each corner, -1 for none."""
        front_end, since = self._estimators.front_end, self._estimators.since_update
        with self._clock.timed("front_end"):
            front_end.move(since.motion, since.motion_cov)
            since.reset()
            association, landmarks = front_end.observe(view.corners_robot, view.identities)
            self._observations.add(len(view.corners_robot), association)
            self._monitor.updated(self._records.stamps[-1], association)
            if view.scan is not None:
                front_end.count_misses(view.scan, self._sensor, landmarks)
            return association, landmarks

    def _add_key_frame(self, view: View, landmarks: NDArray[np.int64]) -> None:
        """Add a key frame to the graph, the line map, the loop closer and the landmark table."""
        estimators = self._estimators
        front_end, odometry, since = estimators.front_end, estimators.odometry, estimators.since_key_frame
        with self._clock.timed("back_end"):
            motion, motion_cov = since.motion, since.motion_cov
            observations = view.observations(landmarks, 1e-3 * self.config.back_end.corner_scatter_mm)
            self._graph.add_key_frame(front_end.ekf.pose, motion, motion_cov, observations)
            if view.scan is None and view.identities is None:
                self._unidentified.append(Sighting(motion, motion_cov, view.corners_robot))
            merge(front_end, self._graph)
            self._graph.update()
            front_end.deactivate_far(len(self._key_frames), landmarks)
            if odometry.scan is not None:
                self._closer.add_key_frame(odometry.scan, view.corners_robot, motion, motion_cov)
            since.reset()
            odometry.add_key_frame()
            self._key_frames.append(KeyFrame.of(self.scans, view, self._sensor))

    def _close_loop(self, view: View) -> None:
        """Search for a loop closure at the newest key frame; after one, move the filter to the pose in the graph."""
        front_end = self._estimators.front_end
        if view.scan is None:
            if front_end.returned:
                rebase(front_end, self._graph)
        elif self.config.loop.enabled:
            with self._clock.timed("loop"):
                close_loop(self._closer, front_end, self._graph)

    def finish(self, *, interrupted: bool = False) -> SlamResult:
        """Solve the graph and put the result together; ``interrupted`` is noted in the metrics.

        Where the graph has no unique solution, the result is that of the filter, and a warning says so.

        Raises
        ------
        ValueError
            No scan was processed.
        """
        if not self._key_frames:
            raise ValueError("no scan was processed: there is nothing to finish")
        if not self._gauge.ready and self._gauge.end():
            self._process_anew()
        with self._clock.timed("back_end"):
            self._solution = solution = self._solve()
        landmarks = landmark_map(solution, self.config.map.min_observations)
        metrics = self._metrics(solution, len(landmarks), interrupted)
        return assemble_result(self._records, self._key_frames, solution.estimate, landmarks, metrics, self.config)

    def _solve(self) -> Solution:
        """Solve the graph; if no observation has a signature or an identity, rebuild it by reassociation first.

        Without signatures only later observations may decide an association, and the filter did not have these.
        """
        graph, table, max_iterations = self._graph, self.landmark_table, self.config.back_end.max_iterations
        if len(self._unidentified) == len(self._key_frames):
            first_pose = graph.poses_world_robot[0]
            graph, table = reassociate(
                self._new_graph(),
                first_pose,
                FIRST_POSE_COV,
                self._unidentified,
                max_iterations,
                self._rules.hypotheses,
            )
        return solve(graph, table, max_iterations)

    def _new_graph(self) -> BackEnd:
        if self._back_end is not None:
            return self._back_end()
        return JournaledGraph(self.config.back_end.cauchy_scale, self._rules.graph)

    def _metrics(self, solution: Solution, landmarks: int, interrupted: bool) -> RunMetrics:
        stamps, odometry = self._records.stamps, self._estimators.odometry
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
            registrations=replace(odometry.counts),
            wheels=odometry.calibration if self.config.odometry.source == "line-aided" else None,
            observations=replace(self._observations),
            landmark_life=solution.table.counts(self.config.map.min_observations),
            closures=replace(self._closer.counts, revoked=len(solution.estimate.revoked)),
            noise=self._gauge.summary(),
            nis=self._monitor.nis,
            trust=self.trust,
            stages=self._clock.stages(),
            graph_converged=solution.estimate.converged,
            interrupted=interrupted,
        )

    @property
    def _estimators(self) -> Estimators:
        if self._started is None:
            raise ValueError("no frame was processed yet")
        return self._started
