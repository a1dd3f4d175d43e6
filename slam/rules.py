"""All that decides in the estimation and does not depend on robot, scanner or building."""

from dataclasses import dataclass

from features.noise.rules import NoiseRules
from slam.filter.rules import FilterRules
from slam.graph.rules import GraphRules, MultiHypothesisRules
from slam.loop.rules import LoopRules
from slam.odometry.rules import CalibrationRules, LineOdometryRules, VelocityRules
from slam.trust.rules import TrustRules


@dataclass(frozen=True, slots=True)
class SlamRules:
    """Rules of every part of :class:`slam.pipeline.Slam`; docs/math.md has the reason of each value.

    Parameters
    ----------
    odometry, wheels, velocity : registration of scans, calibration of wheels, and the motion without wheels.
    filter, graph, hypotheses, loop : the filter, the factor graph, multi-hypothesis association and loop closing.
    noise : measurement of the noise of the scanner.
    trust : what speaks against a run.
    """

    odometry: LineOdometryRules = LineOdometryRules()  # noqa: RUF009, frozen
    wheels: CalibrationRules = CalibrationRules()  # noqa: RUF009, frozen
    velocity: VelocityRules = VelocityRules()  # noqa: RUF009, frozen
    filter: FilterRules = FilterRules()  # noqa: RUF009, frozen
    graph: GraphRules = GraphRules()  # noqa: RUF009, frozen
    hypotheses: MultiHypothesisRules = MultiHypothesisRules()  # noqa: RUF009, frozen
    loop: LoopRules = LoopRules()  # noqa: RUF009, frozen
    noise: NoiseRules = NoiseRules()  # noqa: RUF009, frozen
    trust: TrustRules = TrustRules()  # noqa: RUF009, frozen
