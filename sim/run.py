"""A simulated run: frames as any source yields them, and the truth beside them."""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from drivers.frame import Frame, FrameSource, SourceInfo
from features.se2 import Array
from features.sensor import Mounting
from sim.motion.alpha_odometry import AlphaOdometry
from sim.motion.odometry import Odometry, WheelOdometry
from sim.motion.person import Person
from sim.motion.robot import Robot, Trajectory
from sim.sensing.effects import Effects
from sim.sensing.lidar import Lidar, Measurement
from sim.worlds.built_in.room import room, room_waypoints
from sim.worlds.world import World

POOR_ODOMETRY = WheelOdometry(
    sigma_turn_per_radian=0.01,
    sigma_turn_per_metre=0.004,
    sigma_distance_per_metre=0.01,
    sigma_distance_per_radian=0.005,
    scale_left=1.02,
    scale_right=1.0228,
    wheel_base=0.3,
    base_factor=0.985,
)
"""A cheap robot: wheels a few percent too large, not quite of one size, and a wheel base that was measured badly."""

ODOMETRIES: Mapping[str, Odometry] = MappingProxyType(
    {
        "exact": WheelOdometry(),
        "good": WheelOdometry(
            sigma_turn_per_radian=0.005,
            sigma_turn_per_metre=0.002,
            sigma_distance_per_metre=0.005,
            sigma_distance_per_radian=0.002,
            scale_left=1.002,
            scale_right=1.0022,
            base_factor=0.998,
        ),
        "poor": POOR_ODOMETRY,
        # At 50 records per second the random errors of the poor one, and a slip of 5 cm every 10 m.
        "slipping": AlphaOdometry(
            alpha1=5e-3, alpha2=1.6e-3, alpha3=1e-2, alpha4=1.25e-3, slip_rate=0.1, slip_length=0.05
        ),
    }
)
"""Wheels by the name that the command line takes."""

ROOM_ODOMETRY_RATE = 50.0
"""Odometry records of :func:`room_run` per second [Hz]."""


class SimulatedRun(FrameSource):
    """A robot that drove through a world, as a source of frames.

    Each iteration yields the same frames, one for each pose of the trajectory; those at the lidar's rate have a scan.

    Parameters
    ----------
    name : short name, fit for a folder.
    world : what the lidar sees.
    lidar : the scanner and its mounting.
    sensor : name of the sensor preset that fits the lidar.
    trajectory : the true motion; its rate is a whole multiple of the lidar's.
    odometry : errors of the wheels.
    seed : of all randomness of the run.
    people : who is about.

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
        trajectory: Trajectory,
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
        """Name, sensor and mounting as given; a simulated robot has wheels."""
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
        """Yield the frames, each that has a scan with the truth about its beams."""
        measurements = self.measurements()
        for index, stamp in enumerate(self.stamps.tolist()):
            measurement = next(measurements) if self.has_scan[index] else None
            self._yielded = index + 1
            scan = None if measurement is None else measurement.scan
            yield Frame(stamp, self.poses_odom_robot[index].copy(), scan), measurement

    def measurements(self) -> Iterator[Measurement]:
        """Yield the scans of the frames that have one, in their order, each with the truth about its beams."""
        rng = np.random.default_rng(self._lidar_seed)
        for index in np.flatnonzero(self.has_scan).tolist():
            stamp = float(self.stamps[index])
            poses = self.poses_world_robot[index]
            if self.lidar.effects.sweep_time > 0.0:
                poses = self.trajectory.at(stamp + self.lidar.times)
            yield self.lidar.measure(self.world, poses, stamp, rng, self.people)


def room_run(
    seed: int,
    preset: str = "rplidar-s1",
    mounting: Mounting | None = None,
    effects: Effects = Effects(),  # noqa: B008, frozen
) -> SimulatedRun:
    """Two rounds through the room with odometry that drifts by metres, though hardly at all from scan to scan.

    Parameters
    ----------
    seed : of all randomness of the run.
    preset : sensor to carry: ``rplidar-s1`` or ``sick-lms``.
    mounting : where the sensor sits on the robot; by default at its origin, looking ahead.
    effects : of the sensor beside the noise of the paper; by default none.

    Raises
    ------
    ValueError
        No sensor preset has this name.
    """
    return SimulatedRun(
        name=f"room-{seed}",
        world=room(),
        lidar=Lidar.of_preset(preset, mounting, effects),
        sensor=preset,
        trajectory=Robot().drive(room_waypoints(), ROOM_ODOMETRY_RATE),
        odometry=POOR_ODOMETRY,
        seed=seed,
    )
