"""What speaks against a run; docs/math.md has the reason of each value."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TrustRules:
    """From where on a run is not trusted.

    Parameters
    ----------
    window : updates whose innovations are judged together.
    level : two-sided level of the bounds of a window.
    near : distance up to which a point of a scan shows what one of the scan before showed [m].
    least_overlap : share of such points of two scans taken from nearly the same place, at least.
    fewest_points : of a scan that can be compared.
    small_motion, small_turn : motion between two scans that leaves most of what they show in sight of both [m, rad].
    moving, turning : motion between two scans from which wheels can be judged [m, rad].
    judged : scans in motion over which the wheels are judged.
    most_rejected : share of predictions by the wheels that the scans may prove wrong.
    direction_memory : weight of the directions so far against that of the next scan, where wheels are turned.
    beside_heading : angle from which the wheels are said to be turned [rad].
    blind_travel, blind_turn : motion that may rest on odometry alone [m, rad].
    """

    window: int = 50
    level: float = 0.9999
    near: float = 0.3
    least_overlap: float = 0.5
    fewest_points: int = 30
    small_motion: float = 0.5
    small_turn: float = math.radians(20.0)
    moving: float = 0.02
    turning: float = math.radians(1.0)
    judged: int = 50
    most_rejected: float = 0.3
    direction_memory: float = 0.98
    beside_heading: float = math.radians(20.0)
    blind_travel: float = 5.0
    blind_turn: float = math.pi
