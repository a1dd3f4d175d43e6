"""Measure what jumps of the odometry do: python docs/measure_jumps.py [NAME ...].

A name is that of a world (box, L, corridor, niches) or of a scanner. A robot drives through each world with poor
wheels; in one record its odometry takes a step that the robot did not make, or starts anew at zero. A run counts as
told where trust is lost within a second of the jump; as right where the map has no corner twice and none that is not in
the world, and the trajectory errs by less than 2 cm in the frame of the start; as silently wrong else. Printed is a
table in Markdown. All of it takes some five minutes.
"""

import itertools
import math
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from features.se2 import Array, Pose
from sim import EFFECTS, POOR_ODOMETRY, Lidar, SimulatedRun, World, drive_through
from sim.motion.jumping_odometry import JumpingOdometry
from sim.motion.robot import Robot
from slam.config_file import load_config
from slam.evaluation.evaluate import CORNER_DISTANCE
from slam.pipeline import Slam

RIGHT_M = 0.02
TOLD_S = 1.0

_NICHES = [
    (0.0, 0.0), (2.5, 0.0), (2.5, -0.35), (3.4, -0.35), (3.4, 0.0), (6.0, 0.0), (6.0, -0.35), (6.9, -0.35), (6.9, 0.0),
    (9.5, 0.0), (9.5, -0.35), (10.4, -0.35), (10.4, 0.0), (13.0, 0.0), (13.0, 2.2), (8.4, 2.2), (8.4, 2.55),
    (7.5, 2.55), (7.5, 2.2), (4.9, 2.2), (4.9, 2.55), (4.0, 2.55), (4.0, 2.2), (0.0, 2.2),
]  # fmt: skip

WORLDS: Mapping[str, tuple[World, Array]] = {
    "box": (
        World.from_polygons("box", [[(0, 0), (6, 0), (6, 4), (0, 4)]]),
        np.array([(1.2, 1.2), (4.6, 1.2), (4.6, 2.9), (1.2, 2.9)]),
    ),
    "L": (
        World.from_polygons("L", [[(0, 0), (7, 0), (7, 3), (3, 3), (3, 6), (0, 6)]]),
        np.array([(5.8, 1.5), (1.5, 1.5), (1.5, 4.8)]),
    ),
    "corridor": (
        World.from_polygons("corridor", [[(0, 0), (12, 0), (12, 2), (0, 2)]]),
        np.array([(1.5, 1.0), (10.0, 1.1)]),
    ),
    "niches": (World.from_polygons("niches", [_NICHES]), np.array([(1.5, 1.1), (11.0, 1.0)])),
}

SCANNERS: Mapping[str, Lidar] = {
    "s1": Lidar.of_preset("rplidar-s1"),
    "s1-270": replace(Lidar.of_preset("rplidar-s1"), angles=np.radians(np.arange(-135.0, 135.0, 0.5))),
    "sick-lms": Lidar.of_preset("sick-lms"),
    "s1-effects": Lidar.of_preset("rplidar-s1", effects=EFFECTS["rplidar-s1"]),
}
PRESETS = {"s1": "rplidar-s1", "s1-270": "rplidar-s1", "sick-lms": "sick-lms", "s1-effects": "rplidar-s1"}
"""Scanners of a full turn, of 270 and of 180 degrees, and one that moves while it scans; the sensor preset of each."""

RATES = {"50 Hz": 50.0, "with the scans": 0.0}
"""Odometry records: many between two scans, or one with each scan."""


def jumps() -> Iterator[tuple[str, Pose | None]]:
    """Each jump with its name."""
    for step in (0.3, 0.5, 0.7, 1.0, 2.0, 5.0):
        for name, x, y in (("ahead", 1, 0), ("back", -1, 0), ("left", 0, 1), ("right", 0, -1)):
            yield f"{step:g} m {name}", np.array([x * step, y * step, 0.0])
    for degrees in (90.0, -90.0, 30.0):
        yield f"{degrees:g} deg", np.array([0.0, 0.0, math.radians(degrees)])
    yield "1 m ahead, 90 deg", np.array([1.0, 0.0, math.pi / 2])
    yield "to zero", None


def run(world: World, path: Array, scanner: str, rate: float, motion: Pose | None, seed: int) -> str:
    """Drive with a jump on the way and tell what becomes of it."""
    lidar = SCANNERS[scanner]
    trajectory = drive_through(world, path, Robot(), lidar.rate * max(1, round(rate / lidar.rate)))
    at = int(np.random.default_rng(seed).uniform(0.3, 0.6) * len(trajectory.poses_world_robot))
    odometry = JumpingOdometry(POOR_ODOMETRY, at, motion)
    source = SimulatedRun(world.name, world, lidar, PRESETS[scanner], trajectory, odometry, seed)
    slam = Slam(load_config(None, source=source.info))
    for frame in source:
        slam.process(frame)
    result = slam.finish()
    jumped = source.stamps[at]
    reasons = [reason.stamp for reason in result.metrics.trust.reasons]
    if any(jumped <= stamp <= jumped + TOLD_S for stamp in reasons):
        return "told"
    error = result.trajectory.poses[:, :2] - source.poses_world_robot[:, :2]
    off = math.sqrt((error**2).sum(axis=1).mean())
    apart = np.hypot(*(result.landmarks.positions[:, None] - world.corners).transpose(2, 0, 1))
    mapped = (apart < CORNER_DISTANCE).any(axis=0).sum()
    false = len(apart) - mapped
    if off < RIGHT_M and false == 0:
        return "right"
    return f"wrong: {100 * off:.1f} cm, {false} corners too many"


def main() -> None:
    """Print a row for each world, scanner and rate of the odometry, with what went wrong below."""
    asked = sys.argv[1:]
    worlds = [name for name in WORLDS if name in asked] or list(WORLDS)
    scanners = [name for name in SCANNERS if name in asked] or list(SCANNERS)
    print("| world | scanner | odometry | right | told | silently wrong |\n|---|---|---|---|---|---|")
    for world, scanner, rate in itertools.product(worlds, scanners, RATES):
        became = {
            name: run(*WORLDS[world], scanner, RATES[rate], motion, seed)
            for seed, (name, motion) in enumerate(jumps())
        }  # fmt: skip
        counts = Counter(each.partition(":")[0] for each in became.values())
        wrong = "; ".join(f"{name} ({each[7:]})" for name, each in became.items() if each.startswith("wrong"))
        cells = f"{counts['right']} | {counts['told']} | {counts['wrong']}"
        print(f"| {world} | {scanner} | {rate} | {cells}{': ' + wrong if wrong else ''} |", flush=True)


if __name__ == "__main__":
    main()
