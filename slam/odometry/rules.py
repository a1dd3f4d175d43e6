"""What decides in the odometry; docs/math.md has the reason of each value.

Nothing here depends on the robot, the scanner or the building: what does is configured.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from features.se2 import Array


@dataclass(frozen=True, slots=True)
class SurfaceRules:
    """How the direction of a surface is found at a point of a scan that belongs to no line.

    Parameters
    ----------
    beside : how far on either side points determine the direction of the surface [m].
    same_surface : neighbours farther apart than this do not lie on one surface [m].
    least_length : a surface shorter than this has no known direction [m].
    """

    beside: float = 0.1
    same_surface: float = 0.15
    least_length: float = 0.08


@dataclass(frozen=True, slots=True)
class BeamRules:
    """When a beam has gone through the place of a landmark or of a wall.

    Parameters
    ----------
    behind : how far behind a landmark or a wall a beam has to end to have gone through [m].
    beside : beams on either side of a landmark that all have to go through its place.
    """

    behind: float = 0.3
    beside: int = 2


@dataclass(frozen=True, slots=True)
class RegistrationRules:
    """What a registration takes for the same wall and when it ends.

    Parameters
    ----------
    gate, final_gate : distance up to which a point may belong to a wall, at first and at last [m].
    narrowing : factor of the gate from one iteration to the next.
    gate_sigmas : a gate wider than the last one is so many sigmas of what its residuals err by.
    reach : how far beyond its ends a wall may go on [m].
    nearest : a sensor nearer to the line of a wall than this does not see the wall [m].
    scatter : how far apart the same wall lies as seen from different key frames [m].
    roughness : how far the points of a real wall lie off a straight line, beyond the noise of the sensor [m].
    crookedness : how far the directions of walls err, beyond the noise of the sensor [rad].
    kernel : residual, in sigmas, where the Cauchy kernel halves the weight of a point, and of a wall behind a beam.
    inlier : residual, in sigmas, up to which a point lies on a wall.
    turn : largest angle between a wall and the same wall as a line of the scan [rad].
    surface_turn : largest angle between a wall and the surface at a point that belongs to no line [rad].
    step : change of the pose, in sigmas of the scan, with which the iterations end.
    max_iterations : limit of the iterations.
    """

    gate: float = 0.5
    final_gate: float = 0.15
    narrowing: float = 0.6
    gate_sigmas: float = 4.0
    reach: float = 0.2
    nearest: float = 0.05
    scatter: float = 0.02
    roughness: float = 0.005
    crookedness: float = math.radians(1.0)
    kernel: float = 2.0
    inlier: float = 3.0
    turn: float = math.radians(30.0)
    surface_turn: float = math.radians(60.0)
    step: float = 0.1
    max_iterations: int = 12


@dataclass(frozen=True, slots=True)
class CalibrationRules:
    """How the systematic errors of wheels are learned (eq. M62-M63).

    Parameters
    ----------
    sigma_travel, sigma_turn : sigma of the scale error of travel and turn of wheels of which nothing is known.
    sigma_drift : sigma of their drift [rad/m].
    stretch_travel, stretch_turn : motion that is compared at once [m, rad].
    no_slip : probability that the motion of wheels that have not slipped differs from that of the scans by less than
        what is taken for a slip.
    least_gain : share of the variance that scans must have taken off, for a motion to be known from them.
    """

    sigma_travel: float = 0.05
    sigma_turn: float = 0.05
    sigma_drift: float = math.radians(2.0)
    stretch_travel: float = 1.0
    stretch_turn: float = 1.0
    no_slip: float = 0.99
    least_gain: float = 0.01

    @property
    def first_cov(self) -> Array:
        """Covariance of the calibration of wheels of which nothing is known, shape (3, 3)."""
        return np.diag([self.sigma_travel, self.sigma_turn, self.sigma_drift]) ** 2

    @property
    def slip_gate(self) -> float:
        """Squared Mahalanobis distance of a motion from that of the wheels beyond which they slipped (eq. M64)."""
        return float(chi2.ppf(self.no_slip, 3))


@dataclass(frozen=True, slots=True)
class VelocityRules:
    """How the velocity of a robot without wheels is kept (eq. M34-M35), and how fast no robot is (eq. M90).

    Parameters
    ----------
    weight : of the latest interval in what is known of the intervals of a scanner.
    gap : a longer interval between scans is a gap, and counts for no more than this [s].
    fastest : velocity, in sigmas, beyond which a stamp, a scan or a record of the wheels was wrong.
    sustained : records in a row whose median velocity the wheels have shown.
    """

    weight: float = 0.05
    gap: float = 1.0
    fastest: float = 3.0
    sustained: int = 5


@dataclass(frozen=True, slots=True)
class StandRules:
    """When scans show that the robot stands (eq. M68-M70).

    Parameters
    ----------
    scans : that a stand has at least; the latest half as many are compared with as many at its begin.
    same : probability that displacements of a robot that stands differ by less than what is taken for a motion.
    same_surface : ranges of neighbouring beams that differ by more are of different surfaces [m].
    beside : how far apart the angles of two beams may be that are compared [rad].
    kernel : residual, in robust standard deviations, where the Cauchy kernel halves the weight of a beam.
    fits : times that the fit of a displacement is made.
    """

    scans: int = 20
    same: float = 0.9999
    same_surface: float = 0.3
    beside: float = math.radians(1.0)
    kernel: float = 2.0
    fits: int = 8


@dataclass(frozen=True, slots=True)
class LineOdometryRules:
    """When a scan fits the walls, and what is tried where it does not.

    Parameters
    ----------
    registration, surfaces, beams, stand : rules of the parts.
    sure_share : share of its points that lie on known walls with which a scan is sure to fit.
    least_share : this share at another pose than the predicted one, at least, for that pose to be preferred.
    margin : how much larger than at the prediction it has to be there.
    prediction : probability that a result lies as near to a prediction that is right as it has to.
    unknown_position, unknown_heading : sigma of a motion of which nothing is known [m, rad].
    headings : turns from the predicted heading from which further attempts start [rad].
    no_chance : probability that beams of which each pose explains half tell less for one of them.
    surprise_position, surprise_heading : difference of the prediction from a steady motion with which the latter is
        tried too [m, rad].
    far : motion since the last scan beyond which further attempts start from there too [m].
    still_position, still_heading : sigma up to which a motion is known so well that it needs no scan [m, rad].
    """

    registration: RegistrationRules = RegistrationRules()
    surfaces: SurfaceRules = SurfaceRules()
    beams: BeamRules = BeamRules()
    stand: StandRules = StandRules()
    sure_share: float = 0.45
    least_share: float = 0.3
    margin: float = 0.15
    prediction: float = 0.9999
    unknown_position: float = 0.3
    unknown_heading: float = math.radians(20.0)
    headings: tuple[float, ...] = tuple(math.radians(turn) for turn in (0.0, -8.0, 8.0, -16.0, 16.0))
    no_chance: float = 0.99
    surprise_position: float = 0.15
    surprise_heading: float = math.radians(8.0)
    far: float = 0.3
    still_position: float = 0.005
    still_heading: float = math.radians(0.3)

    @property
    def prediction_gate(self) -> float:
        """Squared Mahalanobis distance of a result from the prediction beyond which the latter is doubted (eq. M64)."""
        return float(chi2.ppf(self.prediction, 3))

    @property
    def beams_gate(self) -> float:
        """Square of the excess of beams for another pose, over their number, that is no chance (eq. M64, M91)."""
        return float(chi2.ppf(self.no_chance, 1))

    @property
    def unknown_cov(self) -> Array:
        """Covariance of a motion of which nothing is known, shape (3, 3)."""
        return np.diag([self.unknown_position, self.unknown_position, self.unknown_heading]) ** 2

    @property
    def still_variances(self) -> Array:
        """Variances of a motion that needs no scan, shape (3,) [m^2, m^2, rad^2]."""
        return np.array([self.still_position, self.still_position, self.still_heading]) ** 2
