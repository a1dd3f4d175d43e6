"""The methods that the studies put side by side."""

from dataclasses import dataclass

from features.config import Covariance, ExtractionConfig, LineFit


@dataclass(frozen=True, slots=True)
class Method:
    """A line fit and the form of its covariance, with the names under which studies show them."""

    key: str
    label: str
    fit: LineFit
    covariance: Covariance = "propagated"

    @property
    def extraction(self) -> ExtractionConfig:
        """Rules of the extraction by this method, all else by default."""
        return ExtractionConfig(fit=self.fit, covariance=self.covariance)


METHODS = (
    Method("cwlf-paper", "CWLF, paper's covariance", "cwlf", "paper"),
    Method("cwlf-propagated", "CWLF, propagated", "cwlf"),
    Method("effective-variance", "effective variance (default)", "effective-variance"),
    Method("arras-siegwart", "Arras-Siegwart", "arras-siegwart"),
    Method("total-least-squares", "total least squares", "total-least-squares"),
)

PAPER_AND_DEFAULT = tuple(method for method in METHODS if method.key in {"cwlf-paper", "effective-variance"})
"""The methods of studies of many different rooms."""

GATE_99 = 9.210340371976184
"""99 % of chi-square with 2 degrees of freedom: a corner outside of it errs more than it should in one of 100."""
