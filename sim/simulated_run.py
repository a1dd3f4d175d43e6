"""A simulated run: frames as any source yields them, and the truth beside them."""

from collections.abc import Iterator, Sequence

import numpy as np

from drivers.frame import Frame, FrameSource, SourceInfo
from features.se2 import Array
from sim.motion.odometry import Odometry
from sim.motion.person import Person
from sim.motion.true_trajectory import TrueTrajectory
from sim.sensing.lidar import Lidar, Measurement
from sim.worlds.world import World


class SimulatedRun(FrameSource):
    """A drive of a robot through a world, as a source of frames.

    Each iteration yields the same frames, one for each pose of the trajectory; those at the rate of the lidar have a
    scan.

    Parameters
    ----------
    name : short name, fit for a folder.
    world : the walls.
    lidar : the scanner and its mounting.
    sensor : name of the sensor preset that fits the lidar.
    trajectory : the true motion; its rate is a whole multiple of the lidar's.
    odometry : model of the odometry.
    seed : seed of all randomness of the run.
    people : the people in the world.

    Attributes
    ----------
    stamps : time of each frame, shape (n,) [s].
    poses_world_robot : true pose of each frame, shape (n, 3) [m, m, rad].
    poses_odom_robot : odometry pose of each frame, shape (n, 3) [m, m, rad]; the first is the true first pose.
    has_scan : whether each frame has a scan, shape (n,).
    world, lidar, trajectory, people : as given.

    Raises
    ------
    ValueError
        The rate of the trajectory is not a whole multiple of the lidar's.
    """

    def __init__(
        self,
        name: str,
        world: World,
        lidar: Lidar,
        sensor: str,
        trajectory: TrueTrajectory,
        odometry: Odometry,
        seed: int,
        people: Sequence[Person] = (),
    ) -> None:
        every = round(trajectory.rate / lidar.rate)
        if every < 1 or abs(every * lidar.rate - trajectory.rate) > 1e-9 * trajectory.rate:
            raise ValueError(
                f"trajectory at {trajectory.rate:g} Hz, lidar at {lidar.rate:g} Hz: "
                "expected a whole multiple of the lidar's rate"
            )
        odometry_seed, self._lidar_seed = np.random.SeedSequence(seed).spawn(2)
        self._info = SourceInfo(name, sensor, lidar.mounting)
        self.world = world
        self.lidar = lidar
        self.people = tuple(people)
        self.trajectory = trajectory
        self.stamps: Array = trajectory.stamps
        self.poses_world_robot: Array = trajectory.poses_world_robot
        self.poses_odom_robot: Array = odometry.record(self.poses_world_robot, np.random.default_rng(odometry_seed))
        self.has_scan = np.arange(len(self.stamps)) % every == 0
        self._yielded = 0

    @property
    def info(self) -> SourceInfo:
        """Name, sensor and mounting of the lidar; a simulated robot has odometry."""
        return self._info

    @property
    def progress(self) -> float:
        """Share of the frames that the latest iteration has yielded, 0 to 1."""
        return self._yielded / len(self)

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.stamps)

    def __iter__(self) -> Iterator[Frame]:
        """Yield the frames in the order of their stamps."""
        for frame, _ in self.measured_frames():
            yield frame

    def measured_frames(self) -> Iterator[tuple[Frame, Measurement | None]]:
        """Yield the frames, those with a scan together with the truth about its beams."""
        measurements = self.measurements()
        for index, stamp in enumerate(self.stamps.tolist()):
            measurement = next(measurements) if self.has_scan[index] else None
            self._yielded = index + 1
            scan = None if measurement is None else measurement.scan
            yield Frame(stamp, self.poses_odom_robot[index].copy(), scan), measurement

    def measurements(self) -> Iterator[Measurement]:
        """Yield all scans in the order of their stamps, each with the truth about its beams."""
        rng = np.random.default_rng(self._lidar_seed)
        for index in np.flatnonzero(self.has_scan).tolist():
            stamp = float(self.stamps[index])
            poses = self.poses_world_robot[index]
            if self.lidar.effects.sweep_time > 0.0:
                poses = self.trajectory.at(stamp + self.lidar.times)
            yield self.lidar.measure(self.world, poses, stamp, rng, self.people)
