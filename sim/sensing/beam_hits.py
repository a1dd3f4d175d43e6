"""What the beams of a scan hit: walls, glass and people."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from features.se2 import Array
from sim.casting.sincos import sincos
from sim.motion.person import Person
from sim.worlds.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """What each beam of a scan hits, shape (n,) each.

    Parameters
    ----------
    ranges : exact range to the hit [m]; inf where the beam hits nothing.
    wall_ids : wall that is hit; -1 where none is.
    person_ids : person who is hit; -1 where none is.
    """

    ranges: Array
    wall_ids: npt.NDArray[np.int64]
    person_ids: npt.NDArray[np.int64]


def cast_beams_at(
    world: World,
    people: Sequence[Person],
    glass_incidence: float,
    poses_world_sensor: Array,
    angles: Array,
    times: Array,
) -> Hits:
    """Find the first wall or person that returns each beam.

    Parameters
    ----------
    world : the walls.
    people : the people in the world.
    glass_incidence : glass returns beams up to this incidence and lets the others through [rad].
    poses_world_sensor : pose of the sensor, shape (3,), or at each beam, shape (n, 3) [m, m, rad].
    angles : direction of each beam, sensor frame, shape (n,) [rad].
    times : when each beam is sent, shape (n,) [s].
    """
    cast = world.cast if poses_world_sensor.ndim == 1 else world.cast_beams
    ranges, wall_ids = cast(poses_world_sensor, angles)
    person_ids = np.full(angles.size, -1)
    clear_glass = glass_incidence < math.pi / 2.0 and bool(world.glass.any())
    if not (clear_glass or people):
        return Hits(ranges, wall_ids, person_ids)
    origins, directions = _beams(poses_world_sensor, angles)
    if clear_glass:
        cos_limit = math.cos(glass_incidence)
        squarely = _cos_to_wall(world, wall_ids, directions) >= cos_limit
        through = np.flatnonzero((wall_ids >= 0) & world.glass[wall_ids] & ~squarely)
        poses = np.broadcast_to(poses_world_sensor, (angles.size, 3))[through]
        ranges[through], wall_ids[through] = world.cast_beams(poses, angles[through], through_glass=True)
        for pane in np.flatnonzero(world.glass).tolist():
            pane_ranges = _hit_pane(world, pane, cos_limit, origins[through], directions[through])
            nearer = pane_ranges < ranges[through]
            ranges[through[nearer]], wall_ids[through[nearer]] = pane_ranges[nearer], pane
    for index, person in enumerate(people):
        person_ranges, _ = person.cast(origins, directions, times)
        nearer = person_ranges < ranges
        ranges[nearer], wall_ids[nearer], person_ids[nearer] = person_ranges[nearer], -1, index
    return Hits(ranges, wall_ids, person_ids)


def cos_incidence(
    world: World, people: Sequence[Person], hits: Hits, poses_world_sensor: Array, angles: Array, times: Array
) -> Array:
    """Return the cosine of the incidence of each beam on what it hit, shape (n,); 1 where it hit nothing.

    Incidence is the angle between the beam and the surface normal. The parameters are those of
    :func:`cast_beams_at`, and its result.
    """
    origins, directions = _beams(poses_world_sensor, angles)
    cosines = np.where(hits.wall_ids >= 0, _cos_to_wall(world, hits.wall_ids, directions), 1.0)
    for index, person in enumerate(people):
        hit = hits.person_ids == index
        cosines[hit] = person.cast(origins[hit], directions[hit], times[hit])[1]
    return cosines


def mix_edges(
    hits: Hits, right: Hits, left: Hits, mixed_share: float, rng: np.random.Generator
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Make mixed pixels of some beams whose two edges hit different things (Tuley et al. 2005).

    Parameters
    ----------
    hits : what the beams hit.
    right, left : what their right and left edges hit.
    mixed_share : probability that a beam whose edges hit different things is mixed.
    rng : source of the choice and of the ranges.

    Returns
    -------
    ranges : those of ``hits``, or where mixed uniform between those of the two edges, shape (n,) [m].
    mixed : whether each beam is mixed, shape (n,).
    """
    n = hits.ranges.size
    apart = (right.wall_ids != left.wall_ids) | (right.person_ids != left.person_ids)
    both = np.isfinite(right.ranges) & np.isfinite(left.ranges)
    mixed = apart & both & (rng.random(n) < mixed_share)
    share = rng.random(n)
    ranges = hits.ranges.copy()
    ranges[mixed] = right.ranges[mixed] + share[mixed] * (left.ranges[mixed] - right.ranges[mixed])
    return ranges, mixed


def _beams(poses_world_sensor: Array, angles: Array) -> tuple[Array, Array]:
    """Return the origin and the unit vector of each beam, shape (n, 2) each, world frame [m]."""
    poses = np.broadcast_to(poses_world_sensor, (angles.size, 3))
    directions = np.empty((2, angles.size))
    sincos(poses[:, 2] + angles, 0.0, *directions)
    return poses[:, :2], directions.T


def _cos_to_wall(world: World, wall_ids: npt.NDArray[np.int64], directions: Array) -> Array:
    """Return the cosine of the incidence of beams on their walls, shape (n,)."""
    return abs((directions * world.normals[wall_ids]).sum(axis=1))


def _hit_pane(world: World, pane: int, cos_limit: float, origins: Array, directions: Array) -> Array:
    """Return the ranges of beams to a pane of glass, shape (n,) [m]; inf where a beam misses or passes through."""
    start, end = world.walls[pane, :2] - origins, world.walls[pane, 2:] - origins
    side_start = directions[:, 0] * start[:, 1] - directions[:, 1] * start[:, 0]
    side_end = directions[:, 0] * end[:, 1] - directions[:, 1] * end[:, 0]
    squarely = abs(directions @ world.normals[pane]) >= cos_limit
    crossed = squarely & (side_start * side_end <= 0.0) & (side_start != side_end)
    share = side_start / np.where(crossed, side_start - side_end, 1.0)
    hit = ((start + share[:, None] * (end - start)) * directions).sum(axis=1)
    return np.where(crossed & (hit > 0.0), hit, np.inf)
