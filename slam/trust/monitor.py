"""Detects reasons not to trust a run while it goes on, and logs each one at once."""

import logging
import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree

from features.se2 import Array, Pose, between, transform
from slam.filter.association import Association
from slam.trust.nis import NisMonitor, NisSummary
from slam.trust.rules import TrustRules

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Reason:
    """A reason not to trust a run.

    Parameters
    ----------
    what : short name.
    stamp : when it was noticed first [s].
    sentence : what was noticed first, and where to look.
    until : when it was noticed last [s].
    """

    what: str
    stamp: float
    sentence: str
    until: float


@dataclass(frozen=True, slots=True)
class Trust:
    """Whether nothing spoke against a run, and if something did, what."""

    ok: bool
    reasons: tuple[Reason, ...]


class TrustMonitor:
    """Collects reasons, each kind once, from its first time until its last.

    Parameters
    ----------
    match_probability : chi-square level of the gate of the association.
    sure_share : share of its points that lie on known walls with which a scan is sure to fit.
    wheels : the motion is predicted by wheels, so that it is these that rejected predictions speak against; else by a
        steady motion.
    rules : from where on a run is not trusted.
    """

    def __init__(
        self,
        match_probability: float,
        sure_share: float,
        *,
        wheels: bool,
        rules: TrustRules = TrustRules(),  # noqa: B008, frozen
    ) -> None:
        self._rules = rules
        self._sure_share = sure_share
        self._nis = NisMonitor(match_probability, rules.window, rules.level)
        self._wheels = wheels
        self._reasons: dict[str, Reason] = {}
        self._points: Array = np.empty((0, 2))
        self._pose_map: Pose | None = None
        self._pose_odom: Pose | None = None
        self._rejected: deque[bool] = deque(maxlen=rules.judged)
        self._directions = 0.0 + 0.0j
        self._travel = self._turn = 0.0
        self._better = False

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
        if self._travel > self._rules.blind_travel or self._turn > self._rules.blind_turn:
            self._add_reason(
                "blind", stamp,
                f"no scan showed a wall over {self._travel:.1f} m and a turn of {math.degrees(self._turn):.0f} deg: "
                "there the motion is known by odometry alone; look at the sensor and its limits of range",
            )  # fmt: skip
        if seen:
            self._travel = self._turn = 0.0

    def jumped(self, stamp: float, share: float | None) -> None:
        """Judge a scan behind a jump of the odometry, by the share of its points that lie on known walls, if any."""
        if share is None or share < self._sure_share:
            self._add_reason(
                "jump", stamp,
                "the odometry jumped, and no scan tells how far the robot went meanwhile: what follows may lie "
                "anywhere relative to what came before; look at the odometry",
            )  # fmt: skip

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
            if share is None or share < self._sure_share:
                self._compare(stamp, points, motion)
            self._judge_predictions(stamp, motion, by_wheels, rejected=rejected)
        self._points, self._pose_map, self._pose_odom = points, pose_map, pose_odom

    def scattered(self, stamp: float, sigma: float, assumed: float) -> None:
        """Judge a standard deviation of ranges that scans show against the one that is assumed [m]."""
        seen = f"the ranges scatter by {1e3 * sigma:.3g} mm about the walls where {1e3 * assumed:.3g} mm is assumed"
        if sigma > assumed:
            self._add_reason(
                "noise", stamp,
                f"{seen}, so that covariances promise too much: look at the scanner, at sigma_range_mm and at "
                'noise = "measured" in [sensor] of the configuration',
            )  # fmt: skip
        elif not self._better:
            self._better = True
            logger.warning('at %.3f s: %s: noise = "measured" in [sensor] would use it', stamp, seen)

    def _compare(self, stamp: float, points: Array, motion: Pose) -> None:
        """Add a reason if a scan hardly overlaps the scan before although the motion was small."""
        rules = self._rules
        small = math.hypot(motion[0], motion[1]) < rules.small_motion and abs(float(motion[2])) < rules.small_turn
        if min(len(points), len(self._points)) < rules.fewest_points or not small:
            return
        here, before = transform(motion, points), self._points
        # Where a door opens or the robot passes a corner, most of a scan is new, but what was in sight still is.
        shares = [
            np.isfinite(KDTree(of).query(points, distance_upper_bound=rules.near)[0]).mean()
            for of, points in ((before, here), (here, before))
        ]
        if max(shares) < rules.least_overlap:
            self._add_reason(
                "carried away", stamp,
                "the scan shows neither the walls known nor what the scan before showed: the robot was carried away, "
                "and what follows may lie anywhere relative to what came before",
            )  # fmt: skip

    def _judge_predictions(self, stamp: float, motion: Pose, by_wheels: Pose, *, rejected: bool) -> None:
        """Add a reason if scans reject too many predictions; name a constant heading offset of the wheels."""
        rules = self._rules
        moved = max(math.hypot(motion[0], motion[1]), math.hypot(by_wheels[0], by_wheels[1])) > rules.moving
        if not (moved or max(abs(motion[2]), abs(by_wheels[2])) > rules.turning):
            return
        self._rejected.append(rejected)
        self._directions = rules.direction_memory * self._directions + complex(*motion[:2]) * complex(
            by_wheels[0], -by_wheels[1]
        )
        share = sum(self._rejected) / rules.judged
        if len(self._rejected) < rules.judged or share <= rules.most_rejected:
            return
        if self._wheels:
            angle = math.atan2(self._directions.imag, self._directions.real)
            beside = f", by which the robot moves {math.degrees(angle):.0f} deg beside its heading"
            turned = beside if abs(angle) > rules.beside_heading else ""
            self._add_reason(
                "odometry", stamp,
                f"the odometry is contradicted by {share:.0%} of {rules.judged} scans{turned}: look at the "
                "odometry and at the mounting of the sensor in the configuration",
            )  # fmt: skip
        else:
            self._add_reason(
                "motion", stamp,
                f"{share:.0%} of {rules.judged} scans fit only where a steady motion does not lead: the robot moves "
                "faster than the scans can follow, or similar places are taken for each other; give odometry or "
                "drive more slowly",
            )  # fmt: skip

    def _add_reason(self, what: str, stamp: float, sentence: str) -> None:
        if (known := self._reasons.get(what)) is not None:
            self._reasons[what] = replace(known, until=stamp)
            return
        self._reasons[what] = Reason(what, stamp, sentence, stamp)
        logger.warning("at %.3f s: %s", stamp, sentence)
