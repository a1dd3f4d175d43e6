"""What decides in the factor graph; docs/math.md has the reason of each value."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from features.se2 import Array


@dataclass(frozen=True, slots=True)
class GraphRules:
    """When a closure is revoked, where the graph is fixed, and how exactly it is solved.

    Parameters
    ----------
    consistent : probability that leaving out a closure that is right lowers the cost by less than for a revocation.
    suspicious : Mahalanobis distance of a closure from the solution up to which it is not suspected.
    most_suspects : closures, those that fit worst, that are tested together.
    coarse, fine : relative change of the cost with which a solve ends, while closures are judged and at last.
    anchor_position, anchor_heading : sigma of the pose of the first key frame [m, rad].
    relinearize : change of a variable with which iSAM2 linearises its factors anew [m, rad].
    relinearize_skip : updates of iSAM2 from one look at these changes to the next.
    """

    consistent: float = 0.9999
    suspicious: float = 2.0
    most_suspects: int = 20
    coarse: float = 1e-4
    fine: float = 1e-6
    anchor_position: float = 1e-4
    anchor_heading: float = 1e-5
    relinearize: float = 0.05
    relinearize_skip: int = 10

    @property
    def anchor_sigmas(self) -> Array:
        """Sigmas of the pose of the first key frame, shape (3,) [m, m, rad]."""
        return np.array([self.anchor_position, self.anchor_position, self.anchor_heading])

    @property
    def closure_gate(self) -> float:
        """What leaving a closure out takes off twice the cost, beyond which the rest contradicts it (eq. M50, M64)."""
        return float(chi2.ppf(self.consistent, 3))


@dataclass(frozen=True, slots=True)
class MultiHypothesisRules:
    """How many hypotheses are kept for how long, and which landmarks are one in the end (eq. M60-M61).

    Parameters
    ----------
    most_hypotheses : kept after an observation, those of the greatest likelihood.
    margin : log-likelihood by which a hypothesis may be below the best one and still turn out right.
    memory : hypotheses with the same landmarks for so many latest observations differ in nothing that is still open.
    new_density : likelihood of an observation of a landmark that is not known yet, in any place [1/m^2].
    one_landmark : probability that two estimates of one landmark are as near as they have to be to be merged.
    """

    most_hypotheses: int = 100
    margin: float = 15.0
    memory: int = 10
    new_density: float = 1e-5
    one_landmark: float = 0.9999

    @property
    def merge_gate(self) -> float:
        """Squared Mahalanobis distance of two landmarks up to which they are one (eq. M61, M64)."""
        return float(chi2.ppf(self.one_landmark, 2))
