"""What decides in the filter beside the gates, which are configured; docs/math.md has the reason of each value."""

import math
from dataclasses import dataclass

from slam.odometry.rules import BeamRules


@dataclass(frozen=True, slots=True)
class FilterRules:
    """How sure the equality of merged landmarks is, how long the association searches, and when a landmark is gone.

    Parameters
    ----------
    merge_sigma : sigma of the distance of two landmarks that are one, in x and y [m].
    most_nodes : of the search tree of the joint compatibility; where they do not suffice the best set so far stands.
    least_sighted : share of the scans that have the place of a landmark in sight, no farther than it was ever seen
        from, in which it has to be seen.
    grazing : a wall that beams meet at a smaller angle than this may show too little of itself [rad].
    beams : when a beam has gone through the place of a landmark.
    """

    merge_sigma: float = 0.01
    most_nodes: int = 20_000
    least_sighted: float = 0.2
    grazing: float = math.radians(15.0)
    beams: BeamRules = BeamRules()  # noqa: RUF009, frozen
