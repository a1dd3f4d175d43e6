"""Which walls and corners a scan without noise shows from a pose."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from features.se2 import Array, Pose, pose
from sim.worlds.world import World

_ROUNDING = 1e-9
"""A beam this near to the direction of a corner may hit either wall of it [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class VisibleSections:
    """Straight sections of a scan: runs of neighbouring beams that hit one wall, counter-clockwise.

    Parameters
    ----------
    wall_ids : wall that each section is a piece of, shape (m,).
    first_beams, last_beams : beams at the two ends of each section, counter-clockwise, shape (m,); a section that
        lies across the first beam of the scan has its first beam behind its last.
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
        """Whether each section has at least so many beams and metres, shape (m,)."""
        return (self.beam_counts >= min_beams) & (self.lengths >= min_length)


def visible_sections(world: World, pose_world_sensor: Pose, beams: int = 920) -> VisibleSections:
    """Split a scan without noise into the pieces of walls that it shows.

    A wall that something hides in the middle is seen in two sections; one that hides between two beams, in one.

    Parameters
    ----------
    world : the walls.
    pose_world_sensor : pose of the sensor, shape (3,) [m, m, rad].
    beams : beams over the full turn; the first looks straight behind the sensor.

    Returns
    -------
    Sections of any size, in the order of their first beams.

    Raises
    ------
    ValueError
        ``beams`` is less than one.
    """
    if beams < 1:
        raise ValueError(f"beams is {beams}: expected at least 1")
    origin = np.asarray(pose_world_sensor[:2], dtype=np.float64)
    angles = _directions(pose_world_sensor, beams)
    ranges, wall_ids = world.cast(pose(*origin), angles)
    first = np.flatnonzero((wall_ids != np.roll(wall_ids, 1)) & (wall_ids >= 0))
    last = np.flatnonzero((wall_ids != np.roll(wall_ids, -1)) & (wall_ids >= 0))
    if len(first) == 0 and wall_ids[0] >= 0:  # the sensor stands on a wall, which covers every beam
        first, last = np.array([0]), np.array([beams - 1])
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
        beam_counts=(last - first) % beams + 1,
    )


def visible_corners(
    world: World, pose_world_sensor: Pose, min_beams: int, min_length: float, beams: int = 920
) -> npt.NDArray[np.int64]:
    """Find the corners whose two walls a scan without noise both shows, up to the corner.

    Parameters
    ----------
    world : the walls and their corners.
    pose_world_sensor : pose of the sensor, shape (3,) [m, m, rad].
    min_beams : beams that each of the two sections that end at the corner has at least.
    min_length : length that each of them has at least, between its first and its last beam [m].
    beams : beams over the full turn; the first looks straight behind the sensor.

    Returns
    -------
    Indices into ``world.corners``, shape (c,), clockwise from where the sensor heads.

    Raises
    ------
    ValueError
        ``beams`` is less than one.
    """
    sections = visible_sections(world, pose_world_sensor, beams)
    shown = sections.shown(min_beams, min_length)
    angles = _directions(pose_world_sensor, beams)
    corner_of = {frozenset(pair): corner for corner, pair in enumerate(world.corner_walls.tolist())}
    found: list[tuple[float, int]] = []
    for index in range(len(sections)):
        following = (index + 1) % len(sections)
        last = int(sections.last_beams[index])
        if not (shown[index] and shown[following]) or sections.first_beams[following] != (last + 1) % beams:
            continue
        corner = corner_of.get(frozenset((int(sections.wall_ids[index]), int(sections.wall_ids[following]))))
        if corner is None:
            continue
        direction = math.atan2(*(world.corners[corner] - pose_world_sensor[:2])[::-1])
        # Of two walls that meet elsewhere, one may end in front of the other.
        behind_last = (direction - angles[last] + _ROUNDING) % (2.0 * math.pi) - _ROUNDING
        if behind_last <= 2.0 * math.pi / beams + _ROUNDING:
            found.append(((pose_world_sensor[2] - direction) % (2.0 * math.pi), corner))
    return np.array([corner for _, corner in sorted(found)], dtype=np.int64)


def _directions(pose_world_sensor: Pose, beams: int) -> Array:
    """Direction of each beam, world frame, shape (beams,) [rad]."""
    return pose_world_sensor[2] - math.pi + 2.0 * math.pi * np.arange(beams) / beams
