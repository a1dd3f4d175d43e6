"""Loop closing: proposals by estimated distance, constellations of corners or walls, verified by registration."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from features.feature import Corners
from features.se2 import Array, Pose, between, compose, inverse, rotation, transform
from slam.graph.values import Closure
from slam.loop.constellation import Constellation, collect_constellation
from slam.loop.dead_reckoning import DeadReckoning
from slam.loop.geometric_hashing import GeometricHash
from slam.loop.rules import LoopCounts, LoopRules
from slam.loop.verification import closure_of, position_sigma, walls_world
from slam.loop.wall_search import Region, search, wall_samples
from slam.odometry.beams import beams_through_walls
from slam.odometry.registration import Registration, register
from slam.odometry.scan_points import ScanPoints


class LoopCloser:
    """Finds closures of the newest submap.

    A single registration may be wrong, as buildings repeat themselves. A closure near the estimated pose therefore has
    to be confirmed by the next search, one proposed by a constellation needs several supporting key frames, and both
    have to agree with dead reckoning.

    Parameters
    ----------
    apart : path length between two visits of a place [m].
    reach : distance between key frames that may show the same place [m].
    share : of the points of a scan those that lie on walls of the submap, at least.
    rules : what else counts as the same place.

    Attributes
    ----------
    counts : what became of the hypotheses.
    """

    def __init__(
        self,
        *,
        apart: float,
        reach: float,
        share: float,
        rules: LoopRules = LoopRules(),  # noqa: B008, frozen
    ) -> None:
        self.counts = LoopCounts()
        self._apart, self._reach, self._share = apart, reach, share
        self._rules = rules
        self._possible_gate = rules.possible_gate
        self._unknown_cov, self._blur_cov = rules.unknown_cov, rules.blur_cov
        self._systematic_cov = rules.systematic_cov
        self._scans: list[ScanPoints] = []
        self._corners: list[Corners] = []
        self._path_lengths: list[float] = []
        self._breaks: list[int] = []
        self._reckoning = DeadReckoning()
        self._last_search = -math.inf
        self._last_closure = -math.inf
        self._last_wall_search = -math.inf
        self._tied = 0
        self._hypothesis: tuple[int, Pose] | None = None
        self._index = GeometricHash(rules.places)
        self._places: list[int] = []
        self._indexed = 0.0

    def add_key_frame(self, scan: ScanPoints, corners_robot: Corners, motion: Pose, motion_cov: Array) -> None:
        """Remember a key frame.

        Parameters
        ----------
        scan, corners_robot : what it shows, robot frame.
        motion, motion_cov : its pose in the frame of the key frame before, shape (3,), and the covariance of the
            coordinates, shape (3, 3); ignored for the first one.
        """
        travel = math.hypot(motion[0], motion[1]) if self._scans else 0.0
        self._scans.append(scan)
        self._corners.append(corners_robot)
        self._path_lengths.append((self._path_lengths[-1] if self._path_lengths else 0.0) + travel)
        broken = bool(self._breaks) and np.linalg.eigvalsh(motion_cov[:2, :2])[1] > self._rules.broken**2
        self._breaks.append((self._breaks[-1] if self._breaks else 0) + broken)
        self._reckoning.add(motion, motion_cov)

    def find(self, poses_world_robot: Array) -> list[Closure]:
        """Return verified closures of the newest submap, given the poses of all key frames, shape (n, 3)."""
        newest = len(self._scans) - 1
        if self._path_lengths[newest] - self._last_search < self._rules.spacing:
            return []
        self._last_search = self._path_lengths[newest]
        self._remember_places(poses_world_robot)
        found = self._near(newest, poses_world_robot)
        if found is None:
            self._hypothesis = None
            # A submap that is tied to an earlier one would only be tied to it again.
            tied = self._path_lengths[newest] - self._last_closure <= self._rules.constellation
            closures = [] if tied else self._by_corners(newest, poses_world_robot)
            if not tied and not closures:
                closures = self._by_walls(newest, poses_world_robot)
        else:
            older, fit = found
            here = poses_world_robot[newest]
            # What moves the estimate onto the registered pose, as a motion of the world about its origin.
            correction = compose(fit.pose_map_robot, inverse(here))
            confirmed = self._hypothesis is not None and self._follows(self._hypothesis, correction, here)
            self._hypothesis = newest, correction
            self.counts.rejected += not confirmed
            closures = (
                [closure_of(older, newest, poses_world_robot[older], fit, self._systematic_cov)] if confirmed else []
            )
        if closures:
            self._last_closure = self._path_lengths[newest]
            self._tied = newest
        self.counts.accepted += len(closures)
        return closures

    def submap(self, key_frame: int) -> NDArray[np.int64]:
        """Earlier key frames near one along the path, whose landmarks become active; none of the present visit."""
        return self._about(key_frame, self._rules.reactivation)

    def _about(self, key_frame: int, reach: float) -> NDArray[np.int64]:
        lengths = np.array(self._path_lengths)
        return np.flatnonzero((np.abs(lengths - lengths[key_frame]) <= reach) & (lengths < lengths[-1] - self._apart))

    def _follows(self, hypothesis: tuple[int, Pose], correction: Pose, here: Pose) -> bool:
        """Whether a correction agrees with that of the previous search, and the path since then is short."""
        searched, earlier = hypothesis
        recent = self._path_lengths[-1] - self._path_lengths[searched] <= self._rules.memory
        return recent and self._agree(compose(earlier, here), compose(correction, here))

    def _agree(self, one: Pose, other: Pose) -> bool:
        """Whether two poses of one key frame agree (eq. M49)."""
        difference = between(one, other)
        return bool(
            math.hypot(difference[0], difference[1]) <= self._rules.agree_position
            and abs(difference[2]) <= self._rules.agree_heading
        )

    def _near(self, newest: int, poses_world_robot: Array) -> tuple[int, Registration] | None:
        """Fit of the newest key frame to the walls of a submap about where it is believed to be."""
        rules = self._rules
        lengths = np.array(self._path_lengths)
        here = poses_world_robot[newest]
        apart = np.hypot(*(poses_world_robot[:newest, :2] - here[:2]).T)
        near = np.flatnonzero((lengths[:newest] < lengths[newest] - self._apart) & (apart < self._reach))
        best: tuple[int, Registration] | None = None
        while near.size:
            nearest = int(near[apart[near].argmin()])
            submap = near[np.abs(lengths[near] - lengths[nearest]) <= rules.submap_length]
            self.counts.proposed_near += 1
            fit = self._fit(newest, walls_world(self._scans, submap, poses_world_robot), here)
            motion = between(poses_world_robot[nearest], fit.pose_map_robot)
            if (
                self._certain(fit)
                and (best is None or fit.share > best[1].share)
                and self._possible(np.array([nearest]), motion[None])[0]
            ):
                best = nearest, fit
            near = near[np.abs(lengths[near] - lengths[nearest]) > 2.0 * rules.submap_length]
        return best

    def _by_corners(self, newest: int, poses_world_robot: Array) -> list[Closure]:
        """Closures of the newest submap and the one place on which its constellation lies."""
        lengths = np.array(self._path_lengths)
        here = self._unbroken(newest, np.flatnonzero(lengths > lengths[newest] - self._rules.constellation))
        corners = self._constellation(newest, here, poses_world_robot)
        places = np.array(self._places, np.int64)
        proposals = self._index.propose(corners, lambda hits, poses: self._possible(places[hits], poses))
        self.counts.proposed_by_corners += len(proposals)
        verified: list[tuple[Pose, list[Closure]]] = []
        for proposal in proposals:
            older = self._places[proposal.place]
            start = compose(poses_world_robot[older], proposal.pose_place_robot)
            supporters = self._supporters(older, newest, start, poses_world_robot)
            if supporters is None:
                self.counts.rejected += 1
            else:
                verified.append(supporters)
        if any(not self._agree(verified[0][0], pose) for pose, _ in verified[1:]):
            # Two places that fit as well: one of them is a copy.
            self.counts.rejected += len(verified)
            return []
        return verified[0][1] if verified else []

    def _by_walls(self, newest: int, poses_world_robot: Array) -> list[Closure]:
        """Closures of the newest submap and the one place in the region of dead reckoning on which its walls lie."""
        rules = self._rules.walls
        lengths = np.array(self._path_lengths)
        if lengths[newest] - self._last_wall_search < rules.spacing:
            return []
        here = poses_world_robot[newest]
        region = self._region(here)
        old = np.flatnonzero(lengths < lengths[newest] - self._apart)
        apart = np.hypot(*(poses_world_robot[old, :2] - here[:2]).T)
        old = old[apart <= region.reach + self._reach]
        # A smaller region is that of the search near by.
        if region.reach <= self._rules.registration.gate or not old.size:
            return []
        self._last_wall_search = lengths[newest]
        recent = self._unbroken(newest, np.flatnonzero(lengths > lengths[newest] - rules.submap))
        samples = wall_samples(walls_world(self._scans, recent, poses_world_robot), rules)
        points = np.ascontiguousarray(transform(inverse(here), samples))
        walls = walls_world(self._scans, old, poses_world_robot)
        if not len(points) or not len(walls):
            return []
        wider = replace(region, cov=region.cov + self._blur_cov)
        found = search(points, walls, wider, self._share, rules)
        if found.pose is None:
            return []
        self.counts.proposed_by_walls += 1
        older = int(old[np.hypot(*(poses_world_robot[old, :2] - found.pose[:2]).T).argmin()])
        closures = self._verified(older, newest, found.pose, poses_world_robot) if found.unique else []
        self.counts.rejected += not closures
        return closures

    def _verified(self, older: int, newest: int, start: Pose, poses_world_robot: Array) -> list[Closure]:
        """Closures by the supporting key frames of a place that was found by its walls; none where it is denied."""
        rules = self._rules.walls
        if not self._possible(np.array([older]), between(poses_world_robot[older], start)[None])[0]:
            return []
        # Of the points of a scan those count that walls can explain at all: in clutter these are few.
        own = walls_world(self._scans, np.array(self._spaced(newest)), poses_world_robot)
        supporters = self._supporters(older, newest, start, poses_world_robot, own)
        if supporters is None or len(supporters[1]) < rules.supporters:
            return []
        pose, closures = supporters
        return closures if self._through(older, newest, pose, poses_world_robot) <= rules.through else []

    def _through(self, older: int, newest: int, pose: Pose, poses_world_robot: Array) -> float:
        """Largest share of beams of a key frame that go through walls of a place, if the newest key frame is there.

        What lies beside the place belongs to no wall of it, and says nothing of a place that is left or entered. But
        nowhere on its way, all along the newest submap, the robot looks through a wall.
        """
        submap = self._unbroken(older, self._about(older, self._rules.constellation))
        walls = walls_world(self._scans, submap, poses_world_robot)
        shares = [0.0]
        for key in self._spaced(newest):
            scan = self._scans[key]
            there = compose(pose, between(poses_world_robot[newest], poses_world_robot[key]))
            shares.append(beams_through_walls(scan, walls, there) / max(len(scan), 1))
        return max(shares)

    def _region(self, here: Pose) -> Region:
        """Where the newest key frame may be, given where it was tied to earlier ones last, world frame (eq. M55)."""
        reckoned, cov = self._reckoning.drift(self._tied)
        turn = np.eye(3)
        turn[:2, :2] = rotation(float(here[2] - reckoned[2]))
        return Region(here, turn @ cov @ turn.T, self._possible_gate)

    def _supporters(
        self, older: int, newest: int, start: Pose, poses_world_robot: Array, own: Array | None = None
    ) -> tuple[Pose, list[Closure]] | None:
        """Pose of the newest key frame and closures by its supporting key frames; None if too few (eq. M54).

        With the walls of the newest submap itself, ``own``, the share of points is asked of those that lie on them.
        """
        rules = self._rules
        submap = self._unbroken(older, self._about(older, rules.constellation))
        walls = walls_world(self._scans, submap, poses_world_robot)
        fits: list[tuple[int, Registration, Pose]] = []
        for key in self._spaced(newest):
            motion = between(poses_world_robot[newest], poses_world_robot[key])
            fit = self._fit(key, walls, compose(start, motion))
            most = 1.0 if own is None else self._fit(key, own, poses_world_robot[key]).share
            if self._certain(fit, most):
                fits.append((key, fit, compose(fit.pose_map_robot, inverse(motion))))
        # Those that agree with the one with which most do.
        alike = [[each for each in fits if self._agree(one[2], each[2])] for one in fits]
        agreed = max(alike, key=len, default=fits)
        if len(agreed) < rules.supporters:
            return None
        _, _, pose = max(agreed, key=lambda each: each[1].share)
        return pose, [
            closure_of(older, key, poses_world_robot[older], fit, self._systematic_cov) for key, fit, _ in agreed
        ]

    def _spaced(self, newest: int) -> list[int]:
        """Key frames of the newest submap, far enough apart along the path to see different points, newest first."""
        rules = self._rules
        lengths = np.array(self._path_lengths)
        submap = self._unbroken(newest, np.flatnonzero(lengths >= lengths[newest] - rules.constellation))
        kept: list[int] = []
        for key in submap[::-1].tolist():
            if not kept or lengths[key] <= lengths[kept[-1]] - rules.supporter_spacing:
                kept.append(key)
        return kept

    def _remember_places(self, poses_world_robot: Array) -> None:
        """Add to the index the submaps that lie far enough behind along the path to be revisited."""
        rules = self._rules
        lengths = np.array(self._path_lengths)
        while self._indexed + rules.constellation < lengths[-1] - self._apart:
            keys = np.flatnonzero((lengths >= self._indexed) & (lengths <= self._indexed + rules.constellation))
            if keys.size:
                middle = int(keys[keys.size // 2])
                keys = self._unbroken(middle, keys)
                self._index.add(self._constellation(middle, keys, poses_world_robot))
                self._places.append(middle)
            self._indexed += rules.constellation / rules.overlap

    def _unbroken(self, home: int, key_frames: NDArray[np.int64]) -> NDArray[np.int64]:
        """Key frames that no increment of large covariance separates from ``home``."""
        return key_frames[np.array(self._breaks)[key_frames] == self._breaks[home]]

    def _constellation(self, home: int, key_frames: NDArray[np.int64], poses_world_robot: Array) -> Constellation:
        """Corners that key frames saw, in the frame of one of them."""
        keys: list[int] = key_frames.tolist()
        poses_home_robot = [between(poses_world_robot[home], poses_world_robot[key]) for key in keys]
        return collect_constellation(poses_home_robot, [self._corners[key] for key in keys], self._rules.places)

    def _fit(self, key_frame: int, walls: Array, start: Pose) -> Registration:
        return register(self._scans[key_frame], walls, start, self._unknown_cov, start, self._rules.registration)

    def _certain(self, fit: Registration, most: float = 1.0) -> bool:
        """Whether a fit tells the position, and enough of the points lie on walls that ``most`` of them belong to."""
        return fit.share >= self._share * most and position_sigma(fit) <= self._rules.sigma

    def _possible(self, older: NDArray[np.int64], motions: Array) -> NDArray[np.bool_]:
        """Whether dead reckoning allows for motions of the newest key frame from older ones, shapes (h,) and (h, 3)."""
        return self._reckoning.distances2(older, motions, self._blur_cov) <= self._possible_gate
