"""Simulated runs with one fault each: of the odometry, the scanner, the surroundings or the configuration."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from drivers.frame import Frame, SourceInfo
from features.scan import LaserScan
from features.se2 import Array, Pose, between, compose, pose
from features.sensor import Mounting
from sim import BUILT_IN, ODOMETRIES, Lidar, SimulatedRun, WorldError, effects_of, find_site, site_run
from slam.config import SlamConfig
from slam.config_file import load_config
from slam.result.trajectory import Trajectory

SCANNERS = "rplidar-s1", "rplidar-a1", "rplidar-a2", "rplidar-a3", "rplidar-s2", "sick-lms"
"""Presets of the scanners that are simulated; each run has one of them at random."""

WITHOUT_WHEELS = 0.25
"""Share of the runs that have no odometry."""

OF_WHEELS = "jump", "slip", "mounting"
"""Faults that are put into runs with odometry only.

Without it a sensor that is turned turns the path in the frame of the start as a whole, which nothing that the run sees
contradicts.
"""

FAULTS = "jump", "slip", "kidnap", "mounting", "noise", "blocked", "glass", "people"
"""What is put in: the odometry jumps, the wheels slip or stand, the robot is carried away, the sensor is mounted
otherwise than configured, its noise is another than configured, a sector of the beams is blocked, walls are of glass,
many people walk about."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What a run gets to see, and what is true.

    Parameters
    ----------
    world : name of the world.
    scanner, effects, odometry : names of the presets; odometry is "none" in a run without wheels.
    fault : one of :data:`FAULTS`, or "none".
    begun : when the fault begins [s]; the first stamp for one that is there throughout, NaN without fault.
    size : how large the fault is: jump and kidnap [m], slip as a factor of what is driven, noise as one of what is
        configured, mounting and blocked [deg], glass as a share of the walls, number of people; NaN without fault.
    rate : scans per second [Hz].
    frames : in the order of their stamps.
    truth : true pose of each frame.
    config : of SLAM.
    """

    world: str
    scanner: str
    effects: str
    odometry: str
    fault: str
    begun: float
    size: float
    rate: float
    frames: list[Frame]
    truth: Trajectory
    config: SlamConfig


def drawn_scene(number: int, fault: str | None, scans: int, seed: int) -> Scene:
    """Draw world, scanner, odometry, people, and where there is a fault its moment and size, by a seed.

    Parameters
    ----------
    number : of the room, where the world is a room drawn at random.
    fault : one of :data:`FAULTS`, None for a run without.
    scans : length of the run.
    seed : of everything else.

    Raises
    ------
    WorldError
        The drawn world cannot be driven through.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3,)))
    kind = int(rng.integers(3))
    world = (f"cluttered-room-{number}", f"random-room-{number}", str(rng.choice(list(BUILT_IN))))[kind]
    scanner = str(rng.choice(SCANNERS))
    effects = str(rng.choice(["ideal", "on"]))
    wheels = fault in OF_WHEELS or rng.random() >= WITHOUT_WHEELS
    odometry = str(rng.choice(["exact", "good", "poor"]))
    people = int(rng.integers(3))
    lidar, size, mounting = Lidar.of_preset(scanner, effects=effects_of(effects, scanner)), math.nan, Mounting()
    site = find_site(world)
    if fault == "people":
        people = int(size := float(rng.integers(5, 20)))
    elif fault == "noise":
        size = float(np.exp(rng.uniform(math.log(2.0), math.log(20.0))))
        lidar = replace(lidar, sigma_range=size * lidar.sigma_range)
    elif fault == "glass":
        size = float(rng.uniform(0.3, 1.0))
        effects = "on"
        lidar = Lidar.of_preset(scanner, effects=effects_of(effects, scanner))
        site = replace(site, glass=rng.random(len(site.walls)) < size)
    elif fault == "mounting":
        size = float(rng.uniform(5.0, 180.0)) * float(rng.choice([-1.0, 1.0]))
        mounting = Mounting(float(rng.uniform(-0.3, 0.3)), float(rng.uniform(-0.3, 0.3)), math.radians(size))
    source: SimulatedRun | None = None
    while source is None:
        try:
            source = site_run(site, lidar, scanner, seed, odometry=ODOMETRIES[odometry], people=people)
        except WorldError:
            if not people:
                raise
            people //= 2
    every = int(np.flatnonzero(source.has_scan)[1])
    first = int(rng.uniform(0.2, 0.7) * scans) * every
    length = int(rng.uniform(30.0, 100.0)) * every if fault == "kidnap" else 0
    frames: list[Frame] = []
    for frame in source:
        frames.append(frame)
        if len(frames) >= scans * every + length:
            break
    truth = source.poses_world_robot[: len(frames)]
    begun = math.nan if fault is None else frames[0].stamp
    if fault in _LATER:
        first = min(first, len(frames) - length - 1)
        begun = frames[first].stamp
        frames, truth, size = _LATER[fault](frames, truth, first, length, rng)
    if not wheels:
        frames = [replace(frame, pose_odom_robot=np.zeros(3)) for frame in frames]
    mounting = Mounting(
        source.mounting.x + mounting.x, source.mounting.y + mounting.y, source.mounting.theta + mounting.theta
    )
    config = load_config(None, source=SourceInfo(source.name, scanner, mounting, has_odometry=wheels))
    stamps = np.array([frame.stamp for frame in frames])
    told = odometry if wheels else "none"
    return Scene(
        world,
        scanner,
        effects,
        told,
        fault or "none",
        begun,
        size,
        lidar.rate,
        frames,
        Trajectory(stamps, truth),
        config,
    )


Changed = tuple[list[Frame], Array, float]
"""Frames with a fault, the true poses of the frames, and the size of the fault."""


def _moved(frames: list[Frame], first: int, motion: Pose) -> list[Frame]:
    """Let the odometry make a motion of its own between two frames."""
    held = frames[first - 1].pose_odom_robot
    start = compose(held, motion)
    return frames[:first] + [
        replace(frame, pose_odom_robot=compose(start, between(held, frame.pose_odom_robot))) for frame in frames[first:]
    ]


def _jump(frames: list[Frame], truth: Array, first: int, _: int, rng: np.random.Generator) -> Changed:
    """Add a motion of 0.3 to 5 m and up to half a turn to the odometry at one frame."""
    size, direction = float(np.exp(rng.uniform(math.log(0.3), math.log(5.0)))), rng.uniform(-math.pi, math.pi)
    turn = rng.uniform(-math.pi, math.pi) * rng.integers(2)
    jump = pose(size * math.cos(direction), size * math.sin(direction), turn)
    return _moved(frames, max(first, 1), jump), truth, size


def _slip(frames: list[Frame], truth: Array, first: int, _: int, rng: np.random.Generator) -> Changed:
    """Let the odometry tell 0 to 3 times what is driven over 1 to 5 s."""
    factor, end = float(rng.uniform(0.0, 3.0)), frames[first].stamp + float(rng.uniform(1.0, 5.0))
    odometry = frames[0].pose_odom_robot
    changed = [frames[0]]
    for record, (before, frame) in enumerate(pairwise(frames), start=1):
        motion = between(before.pose_odom_robot, frame.pose_odom_robot)
        odometry = compose(odometry, factor * motion if record >= first and frame.stamp < end else motion)
        changed.append(replace(frame, pose_odom_robot=odometry))
    return changed, truth, factor


def _kidnap(frames: list[Frame], truth: Array, first: int, length: int, _: np.random.Generator) -> Changed:
    """Take the robot, unseen, to where it would have been some seconds later; wheels and clock do not notice."""
    after = frames[first + length :]
    waited = after[0].stamp - frames[first].stamp
    held, skipped = frames[first - 1].pose_odom_robot, frames[first + length - 1].pose_odom_robot
    moved = [
        Frame(
            frame.stamp - waited,
            compose(held, between(skipped, frame.pose_odom_robot)),
            frame.scan and replace(frame.scan, stamp=frame.scan.stamp - waited),
        )
        for frame in after
    ]
    way = float(np.hypot(*(truth[first + length, :2] - truth[first, :2])))
    return frames[:first] + moved, np.concatenate([truth[:first], truth[first + length :]]), way


def _blocked(frames: list[Frame], truth: Array, first: int, _: int, rng: np.random.Generator) -> Changed:
    """Block a sector of 60 to 300 deg: its beams end at the robot itself, or do not return."""
    width, begin = float(rng.uniform(60.0, 300.0)), float(rng.uniform(-math.pi, math.pi))
    shown = float(rng.choice([0.3, math.inf]))

    def block(scan: LaserScan) -> LaserScan:
        inside = np.mod(scan.angles - begin, 2.0 * math.pi) < math.radians(width)
        return replace(scan, ranges=np.where(inside, shown, scan.ranges))

    changed = [
        replace(frame, scan=block(frame.scan)) if record >= first and frame.scan is not None else frame
        for record, frame in enumerate(frames)
    ]
    return changed, truth, width


_LATER: Mapping[str | None, Callable[[list[Frame], Array, int, int, np.random.Generator], Changed]] = MappingProxyType(
    {"jump": _jump, "slip": _slip, "kidnap": _kidnap, "blocked": _blocked}
)
"""Faults that begin in the middle of a run."""
