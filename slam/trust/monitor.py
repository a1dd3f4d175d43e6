"""What makes a run untrustworthy, noticed while it goes on and said at once."""

import logging
import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from features.se2 import Array, Pose, between, transform
from slam.filter.association import Association
from slam.odometry.line_odometry import SURE_SHARE
from slam.trust.nis import NisMonitor, NisSummary

logger = logging.getLogger(__name__)

NEAR = 0.3
"""Distance up to which a point of a scan shows what one of the scan before showed [m]."""

LEAST_OVERLAP = 0.5
"""Share of such points of two scans taken from nearly the same place, at least; on real logs it is above 0.7."""

SMALL_MOTION, SMALL_TURN = 0.5, math.radians(20.0)
"""Motion between two scans that leaves most of what they show in sight of both [m, rad]."""

FEWEST_POINTS = 30
"""Of a scan that can be compared."""

MOVING, TURNING = 0.02, math.radians(1.0)
"""Motion between two scans from which wheels can be judged [m, rad]."""

JUDGED = 50
"""Scans in motion over which the wheels are judged."""

MOST_REJECTED = 0.3
"""Share of predictions by the wheels that the scans may prove wrong."""

BLIND_TRAVEL, BLIND_TURN = 5.0, math.pi
"""Motion that may rest on odometry alone [m, rad]."""


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason not to trust a run.

    Parameters
    ----------
    what : short name.
    stamp : when it was noticed first [s].
    sentence : what was noticed, and where to look.
    """

    what: str
    stamp: float
    sentence: str


@dataclass(frozen=True, slots=True)
class Trust:
    """Whether nothing spoke against a run, and if something did, what."""

    ok: bool
    reasons: tuple[Reason, ...]


class TrustMonitor:
    """Collects reasons, each kind once, at its first time.

    Parameters
    ----------
    match_probability : chi-square level of the gate of the association.
    wheels : the motion is predicted by wheels, so that they may be judged by the scans.
    """

    def __init__(self, match_probability: float, *, wheels: bool) -> None:
        self._nis = NisMonitor(match_probability)
        self._wheels = wheels
        self._reasons: dict[str, Reason] = {}
        self._points: Array = np.empty((0, 2))
        self._pose_map: Pose | None = None
        self._pose_odom: Pose | None = None
        self._rejected: deque[bool] = deque(maxlen=JUDGED)
        self._directions = 0.0 + 0.0j
        self._travel = self._turn = 0.0

    @property
    def trust(self) -> Trust:
        """What is known so far."""
        return Trust(not self._reasons, tuple(self._reasons.values()))

    @property
    def nis(self) -> NisSummary | None:
        """NIS so far; None where nothing was matched."""
        return self._nis.summary()

    def updated(self, stamp: float, association: Association) -> None:
        """Judge an update of the filter."""
        if self._nis.add(association.nis, len(association.corners)):
            self._add_reason(
                "innovations", stamp,
                "the corners lie farther from where the filter expects them than it promises (NIS above its bounds): "
                "look at the noise of the sensor and of the odometry",
            )  # fmt: skip

    def drove(self, stamp: float, motion: Pose, *, seen: bool) -> None:
        """Judge a motion, shape (3,), at whose end walls or landmarks were ``seen`` or not."""
        self._travel += math.hypot(motion[0], motion[1])
        self._turn += abs(float(motion[2]))
        if self._travel > BLIND_TRAVEL or self._turn > BLIND_TURN:
            self._add_reason(
                "blind", stamp,
                f"no scan showed a wall over {self._travel:.1f} m and a turn of {math.degrees(self._turn):.0f} deg: "
                "there the odometry alone told the motion; look at the sensor and its limits of range",
            )  # fmt: skip
        if seen:
            self._travel = self._turn = 0.0

    def registered(
        self, stamp: float, points: Array, pose_map: Pose, pose_odom: Pose, share: float | None, *, rejected: bool
    ) -> None:
        """Judge a scan that was to be registered.

        Parameters
        ----------
        stamp : of the scan [s].
        points : robot frame, shape (n, 2) [m].
        pose_map, pose_odom : of the robot, by odometry as configured and by the wheels, shape (3,).
        share : of the points that lie on known walls; None where it fitted nowhere.
        rejected : it fitted where the prediction did not allow it.
        """
        if self._pose_map is not None and self._pose_odom is not None:
            motion, by_wheels = between(self._pose_map, pose_map), between(self._pose_odom, pose_odom)
            if share is None or share < SURE_SHARE:
                self._compare(stamp, points, motion)
            if self._wheels:
                self._judge_wheels(stamp, motion, by_wheels, rejected=rejected)
        self._points, self._pose_map, self._pose_odom = points, pose_map, pose_odom

    def _compare(self, stamp: float, points: Array, motion: Pose) -> None:
        """Say so where a scan shows nothing of what the scan before showed from nearly the same place."""
        if min(len(points), len(self._points)) < FEWEST_POINTS or not _small(motion):
            return
        distances, _ = KDTree(self._points).query(transform(motion, points), distance_upper_bound=NEAR)
        if np.isfinite(distances).mean() < LEAST_OVERLAP:
            self._add_reason(
                "carried away", stamp,
                "the scan shows neither the walls known nor what the scan before showed: the robot was carried away, "
                "and what follows may lie anywhere relative to what came before",
            )  # fmt: skip

    def _judge_wheels(self, stamp: float, motion: Pose, by_wheels: Pose, *, rejected: bool) -> None:
        """Say so where the scans often prove the wheels wrong, and by which angle if it is always the same."""
        moved = max(math.hypot(motion[0], motion[1]), math.hypot(by_wheels[0], by_wheels[1])) > MOVING
        if not (moved or max(abs(motion[2]), abs(by_wheels[2])) > TURNING):
            return
        self._rejected.append(rejected)
        self._directions = 0.98 * self._directions + complex(*motion[:2]) * complex(by_wheels[0], -by_wheels[1])
        share = sum(self._rejected) / JUDGED
        if len(self._rejected) == JUDGED and share > MOST_REJECTED:
            angle = math.degrees(math.atan2(self._directions.imag, self._directions.real))
            turned = f", by which the robot moves {angle:.0f} deg beside its heading" if abs(angle) > 20.0 else ""
            self._add_reason(
                "odometry", stamp,
                f"the odometry is contradicted by {share:.0%} of {JUDGED} scans{turned}: look at the "
                "odometry and at the mounting of the sensor in the configuration",
            )  # fmt: skip

    def _add_reason(self, what: str, stamp: float, sentence: str) -> None:
        if what not in self._reasons:
            self._reasons[what] = Reason(what, stamp, sentence)
            logger.warning("at %.3f s: %s", stamp, sentence)


def _small(motion: Pose) -> bool:
    return math.hypot(motion[0], motion[1]) < SMALL_MOTION and abs(float(motion[2])) < SMALL_TURN
