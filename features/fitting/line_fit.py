"""Fits of a straight line to the points of one segment, one interface for all methods."""

import numpy as np

from features.config import METHODS, Covariance, LineFit
from features.errors import DegenerateSegmentError
from features.feature import LINE_RECORD, Line, Lines
from features.fitting.fit_kernels import fit_kernel, project_ends
from features.se2 import Array
from features.sensor import SensorModel


def fit_line(
    ranges: Array,
    angles: Array,
    model: SensorModel,
    fit: LineFit = "effective-variance",
    covariance: Covariance = "propagated",
) -> Line:
    """Fit a line to the points of one segment.

    ``cwlf`` is eq. 20-35 with eq. 31-32 (``paper``) or eq. M4-M6 (``propagated``) for its covariance;
    ``arras-siegwart`` eq. 3 and 16-19; ``effective-variance`` the maximum of the likelihood under eq. 1, eq. M21-M24;
    ``total-least-squares`` eq. 16-19 with equal weights.

    Parameters
    ----------
    ranges, angles : polar coordinates of the points, sensor frame, shape (n,), n >= 2 [m, rad].
    model : sigma_range [m] and sigma_bearing [rad] of a single beam.
    fit : method.
    covariance : form of the covariance; ``paper`` for ``cwlf`` only.

    Raises
    ------
    DegenerateSegmentError
        Fewer than two points, a point at the sensor itself or not finite, or all points coincide.
    ValueError
        The paper's covariance is asked of another method than CWLF.
    """
    if (fit, covariance) not in METHODS:
        raise ValueError(f"the paper's covariance (eq. 31-32) belongs to cwlf, not to {fit}")
    if ranges.size < 2:
        raise DegenerateSegmentError(f"{ranges.size} points do not define a line: expected two or more")
    if not (np.isfinite(ranges) & (ranges > 0.0) & np.isfinite(angles)).all():
        raise DegenerateSegmentError("a segment needs finite angles and positive, finite ranges")
    xs, ys = ranges * np.cos(angles), ranges * np.sin(angles)
    lines = np.zeros(1, LINE_RECORD)
    variances = model.sigma_range**2, model.sigma_bearing**2
    if not fit_kernel(xs, ys, *variances, METHODS.index((fit, covariance)), lines[0]):
        raise DegenerateSegmentError(f"all {ranges.size} points coincide")
    lines["count"] = ranges.size
    project_ends(xs, ys, lines[0])
    return Lines(lines)[0]


def fit_cwlf(ranges: Array, angles: Array, model: SensorModel, covariance: Covariance = "propagated") -> Line:
    """Fit a line by conditional weighted linear regression: :func:`fit_line` with the paper's method."""
    return fit_line(ranges, angles, model, "cwlf", covariance)
