"""Visibility: the walls and corners that a scan without noise shows from a pose."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from features.se2 import Array, Pose, pose
from sim.worlds.world import World

_ROUNDING = 1e-9
"""A beam this near to the direction of a corner may hit either of its walls, by rounding [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class VisibleSections:
    """Sections of a scan: runs of neighbouring beams that hit the same wall, counter-clockwise.

    Parameters
    ----------
    wall_ids : wall of each section, shape (m,).
    first_beams, last_beams : beams at the two ends of each section, counter-clockwise, shape (m,); in a
        section that wraps around the end of the scan the first is the larger number.
    lengths : distance between the points that the first and the last beam hit, shape (m,) [m].
    beam_counts : beams on each section, shape (m,).
    """

    wall_ids: npt.NDArray[np.int64]
    first_beams: npt.NDArray[np.int64]
    last_beams: npt.NDArray[np.int64]
    lengths: Array
    beam_counts: npt.NDArray[np.int64]

    def __len__(self) -> int:
        """Count the sections."""
        return len(self.wall_ids)

    def shown(self, min_beams: int, min_length: float) -> npt.NDArray[np.bool_]:
        """Return whether each section has at least this number of beams and this length [m], shape (m,)."""
        return (self.beam_counts >= min_beams) & (self.lengths >= min_length)


def visible_sections(world: World, pose_world_sensor: Pose, beams: int | Array = 920) -> VisibleSections:
    """Split a scan without noise into the sections of walls that it shows.

    A wall whose middle is hidden is seen in two sections. What lies between two beams does not split a wall.

    Parameters
    ----------
    world : the walls.
    pose_world_sensor : pose of the sensor, shape (3,) [m, m, rad].
    beams : number of beams over the full turn, the first of which points straight back; or the direction of each beam,
        counter-clockwise and evenly spaced, sensor frame, shape (n,) [rad].

    Returns
    -------
    Sections of any size, in the order of their first beams.

    Raises
    ------
    ValueError
        ``beams`` is less than one.
    """
    origin = np.asarray(pose_world_sensor[:2], dtype=np.float64)
    angles = _directions(pose_world_sensor, beams)
    ranges, wall_ids = world.cast(pose(*origin), angles)
    before, after = np.roll(wall_ids, 1), np.roll(wall_ids, -1)
    if not _is_full_turn(angles):
        before[0] = after[-1] = -1
    first = np.flatnonzero((wall_ids != before) & (wall_ids >= 0))
    last = np.flatnonzero((wall_ids != after) & (wall_ids >= 0))
    if len(first) == 0 and wall_ids[0] >= 0:  # the sensor is on a wall, which every beam hits
        first, last = np.array([0]), np.array([len(angles) - 1])
    elif len(first) > 0 and last[0] < first[0]:
        last = np.roll(last, -1)
    ends = [
        origin + ranges[at, None] * np.column_stack([np.cos(angles[at]), np.sin(angles[at])]) for at in (first, last)
    ]
    return VisibleSections(
        wall_ids=wall_ids[first],
        first_beams=first,
        last_beams=last,
        lengths=np.hypot(*(ends[1] - ends[0]).T),
        beam_counts=(last - first) % len(angles) + 1,
    )


def visible_corners(
    world: World, pose_world_sensor: Pose, min_beams: int, min_length: float, beams: int | Array = 920
) -> npt.NDArray[np.int64]:
    """Find the corners of which a scan without noise shows both walls up to the corner.

    Parameters
    ----------
    world : the walls and their corners.
    pose_world_sensor : pose of the sensor, shape (3,) [m, m, rad].
    min_beams : least number of beams of each of the two sections that end at the corner.
    min_length : least length of each of them, between its first and its last beam [m].
    beams : as in :func:`visible_sections`.

    Returns
    -------
    Indices into ``world.corners``, shape (c,), clockwise from the heading of the sensor.

    Raises
    ------
    ValueError
        ``beams`` is less than one.
    """
    sections = visible_sections(world, pose_world_sensor, beams)
    shown = sections.shown(min_beams, min_length)
    angles = _directions(pose_world_sensor, beams)
    spacing = 2.0 * math.pi / len(angles) if _is_full_turn(angles) else float(angles[1] - angles[0])
    corner_of = {frozenset(pair): corner for corner, pair in enumerate(world.corner_walls.tolist())}
    found: list[tuple[float, int]] = []
    for index in range(len(sections)):
        following = (index + 1) % len(sections)
        last = int(sections.last_beams[index])
        if not (shown[index] and shown[following]) or sections.first_beams[following] != (last + 1) % len(angles):
            continue
        corner = corner_of.get(frozenset((int(sections.wall_ids[index]), int(sections.wall_ids[following]))))
        if corner is None:
            continue
        direction = math.atan2(*(world.corners[corner] - pose_world_sensor[:2])[::-1])
        # The sections may also be neighbours because one wall ends in front of the other, away from their corner.
        behind_last = (direction - angles[last] + _ROUNDING) % (2.0 * math.pi) - _ROUNDING
        if behind_last <= spacing + _ROUNDING:
            found.append(((pose_world_sensor[2] - direction) % (2.0 * math.pi), corner))
    return np.array([corner for _, corner in sorted(found)], dtype=np.int64)


def _directions(pose_world_sensor: Pose, beams: int | Array) -> Array:
    """Return the direction of each beam, world frame, shape (n,) [rad]."""
    if not isinstance(beams, int):
        return pose_world_sensor[2] + beams
    if beams < 1:
        raise ValueError(f"beams is {beams}: expected at least 1")
    return pose_world_sensor[2] - math.pi + 2.0 * math.pi * np.arange(beams) / beams


def _is_full_turn(angles: Array) -> bool:
    """Whether the first of evenly spaced beams follows on the last one."""
    return len(angles) * (angles[-1] - angles[0]) >= (len(angles) - 1) * 2.0 * math.pi - _ROUNDING
