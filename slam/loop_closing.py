"""Loop closing: key frames that show a place again, recognised near by and verified by registering their walls."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose, between, compose, inverse, rotation, wrap_angle
from slam.graph import Closure
from slam.line_map import NORMAL_X, NORMAL_Y, WALL_X, WALL_Y
from slam.registration import Registration, RegistrationRules, register
from slam.scan_points import ScanPoints

RULES = RegistrationRules(gate=1.0)

UNKNOWN = np.diag([1.0, 1.0, math.radians(10.0)]) ** 2
"""Covariance of where a hypothesis puts the robot."""

SYSTEMATIC = np.diag([0.02, 0.02, math.radians(0.5)]) ** 2
"""Covariance that two registrations of the same place share: walls that are not straight, things that were moved."""


@dataclass(frozen=True, slots=True)
class LoopRules:
    """What counts as the same place.

    Parameters
    ----------
    apart : way driven between two visits of a place [m].
    spacing : way between two looks for a closure [m].
    reach : distance between key frames that may show the same place [m].
    passage : way whose walls, before and behind a key frame, are put together [m].
    share : of the points of a scan those that lie on walls of the passage, at least.
    sigma : largest standard deviation of the position in its least certain direction [m].
    agree_position, agree_heading : how far two corrections in a row may differ [m, rad].
    """

    apart: float = 15.0
    spacing: float = 0.5
    reach: float = 5.0
    passage: float = 8.0
    share: float = 0.6
    sigma: float = 0.05
    agree_position: float = 0.3
    agree_heading: float = math.radians(4.0)


class LoopCloser:
    """Finds closures of the newest key frame.

    One registration may be deceived. Where it would move the newest key frame, the next look has to find the same: only
    two that agree make a closure.
    """

    def __init__(self, rules: LoopRules) -> None:
        self._rules = rules
        self._scans: list[ScanPoints] = []
        self._way: list[float] = []
        self._looked = -math.inf
        self._hypothesis: tuple[int, Pose] | None = None

    def add_key_frame(self, scan: ScanPoints, travel: float) -> None:
        """Remember a key frame, ``travel`` [m] beyond the one before."""
        self._scans.append(scan)
        self._way.append((self._way[-1] if self._way else 0.0) + travel)

    def find(self, poses_world_robot: Array) -> Closure | None:
        """Closure of the newest key frame, given where all of them are, shape (n, 3); None where none is certain."""
        newest = len(self._scans) - 1
        if self._way[newest] - self._looked < self._rules.spacing:
            return None
        self._looked = self._way[newest]
        found = self._recognise(newest, poses_world_robot)
        if found is None:
            self._hypothesis = None
            return None
        older, fit = found
        here = poses_world_robot[newest]
        # What moves the estimate onto the registered pose, as a motion of the world about its origin.
        correction = compose(fit.pose_map_robot, inverse(here))
        confirmed = self._hypothesis is not None and self._agrees(self._hypothesis, correction, here)
        self._hypothesis = newest, correction
        return _closure(older, newest, poses_world_robot[older], fit) if confirmed else None

    def _agrees(self, hypothesis: tuple[int, Pose], correction: Pose, here: Pose) -> bool:
        """Whether two corrections put the robot at the same place, and the earlier one is not long ago."""
        looked, earlier = hypothesis
        if self._way[-1] - self._way[looked] > 4.0 * self._rules.spacing:
            return False
        difference = between(compose(earlier, here), compose(correction, here))
        return bool(
            math.hypot(difference[0], difference[1]) <= self._rules.agree_position
            and abs(difference[2]) <= self._rules.agree_heading
        )

    def passage(self, key_frame: int) -> NDArray[np.int64]:
        """Key frames, except those of this visit, within a passage of the way of one, on either side of it."""
        way = np.array(self._way)
        beside = np.abs(way - way[key_frame]) <= 2.0 * self._rules.passage
        return np.flatnonzero(beside & (way < way[-1] - self._rules.apart))

    def _recognise(self, newest: int, poses_world_robot: Array) -> tuple[int, Registration] | None:
        rules = self._rules
        way = np.array(self._way)
        here = poses_world_robot[newest]
        apart = np.hypot(*(poses_world_robot[:newest, :2] - here[:2]).T)
        near = np.flatnonzero((way[:newest] < way[newest] - rules.apart) & (apart < rules.reach))
        best: tuple[int, Registration] | None = None
        while near.size:
            nearest = int(near[apart[near].argmin()])
            passage = near[np.abs(way[near] - way[nearest]) <= rules.passage]
            fit = register(self._scans[newest], self._walls(passage, poses_world_robot), here, UNKNOWN, here, RULES)
            if fit.share >= rules.share and _sigma(fit) <= rules.sigma and (best is None or fit.share > best[1].share):
                best = nearest, fit
            near = near[np.abs(way[near] - way[nearest]) > 2.0 * rules.passage]
        return best

    def _walls(self, key_frames: NDArray[np.int64], poses_world_robot: Array) -> Array:
        """Walls of key frames, world frame, shape (m, WALL_FIELDS)."""
        each = [self._scans[key].walls_robot for key in key_frames]
        walls = np.concatenate(each)
        homes = poses_world_robot[np.repeat(key_frames, [len(of_one) for of_one in each])]
        c, s = np.cos(homes[:, 2]), np.sin(homes[:, 2])
        for x, y in ((WALL_X, WALL_Y), (NORMAL_X, NORMAL_Y)):
            walls[:, x], walls[:, y] = c * walls[:, x] - s * walls[:, y], s * walls[:, x] + c * walls[:, y]
        walls[:, [WALL_X, WALL_Y]] += homes[:, :2]
        return walls


def _sigma(fit: Registration) -> float:
    """Return the standard deviation of a position in its least certain direction, by the scan alone [m]."""
    information = fit.information
    if not information[2, 2] > 0.0:
        return math.inf
    arm = information[:2, 2:] @ information[2:, :2] / information[2, 2]
    least = float(np.linalg.eigvalsh(information[:2, :2] - arm)[0])
    return 1.0 / math.sqrt(least) if least > 0.0 else math.inf


def _closure(older: int, newer: int, pose_world_older: Pose, fit: Registration) -> Closure:
    motion = between(pose_world_older, fit.pose_map_robot)
    motion[2] = wrap_angle(float(motion[2]))
    turn = np.eye(3)
    turn[:2, :2] = rotation(float(pose_world_older[2])).T
    cov = turn @ np.linalg.inv(fit.information) @ turn.T + SYSTEMATIC
    return Closure(older, newer, motion, cov)
