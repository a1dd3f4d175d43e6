"""What is asked of SLAM in a building, and whether a study of simulated runs shows it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from slam.evaluation.metrics import mean_interval


@dataclass(frozen=True, slots=True)
class Bar:
    """A figure of a study and the limits that it shall keep.

    Parameters
    ----------
    label : what the figure is.
    value : the figure; None where the study has none, which no limit admits.
    low, high : limits, both included; None for none.
    factor, unit : of the display.
    """

    label: str
    value: float | None
    low: float | None = None
    high: float | None = None
    factor: float = 1.0
    unit: str = ""

    @property
    def holds(self) -> bool:
        """Whether the figure is within its limits."""
        return (
            self.value is not None
            and (self.low is None or self.value >= self.low)
            and (self.high is None or self.value <= self.high)
        )

    def cells(self) -> list[str]:
        """Label, figure, limits and verdict as they are displayed."""
        value = "-" if self.value is None else f"{self.factor * self.value:.4g}"
        low, high = (None if limit is None else f"{self.factor * limit:.4g}" for limit in (self.low, self.high))
        limits = f"{low} .. {high}" if low and high else f"at least {low}" if low else f"at most {high}"
        return [f"{self.label} [{self.unit}]" if self.unit else self.label, value, limits, _VERDICTS[self.holds]]


_VERDICTS = {True: "holds", False: "MISSED"}


def bars(summary: Mapping[str, Any]) -> list[Bar]:
    """Figures of :func:`slam.study.monte_carlo.runs.monte_carlo_summary` with what is asked of each."""
    figures, nees = summary["figures"], summary["nees"]

    def figure(name: str, key: str) -> float | None:
        return None if figures[name] is None else figures[name][key]

    graph, ekf = nees.get("pose, graph"), nees.get("pose, filter")
    low, high = mean_interval(3, 1) if graph is None else graph["interval_95"]
    return [
        Bar("runs that failed", len(summary["failures"]), high=0),
        Bar("graphs without convergence", summary["graph_not_converged"], high=0),
        Bar("ATE, final, worst run", figure("ate_final_m", "worst"), high=0.05, factor=1e3, unit="mm"),
        Bar("landmark RMSE, worst run", figure("landmark_rmse_m", "worst"), high=0.04, factor=1e3, unit="mm"),
        Bar("association precision", figure("association_precision", "mean"), low=0.995, factor=100.0, unit="%"),
        Bar("association recall", figure("association_recall", "mean"), low=0.95, factor=100.0, unit="%"),
        Bar("duplicates", figure("duplicates_share", "mean"), high=0.03, factor=100.0, unit="%"),
        Bar("false closures", figure("closures_false", "worst"), high=0),
        Bar("pose NEES, graph", None if graph is None else graph["mean"], low, high),
        Bar("pose NEES, filter", None if ekf is None else ekf["mean"], high=4.5),
    ]


def bars_table(of: Sequence[Bar]) -> list[list[str]]:
    """Cells of the bars, a heading first."""
    return [["", "found", "asked", ""], *(bar.cells() for bar in of)]
