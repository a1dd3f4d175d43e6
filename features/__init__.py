"""Lines and corners of 2D laser scans, with covariances (CWLF).

The package promises :func:`extract` and the values that it takes and gives; ``features.se2`` and ``features.signature``
serve the other packages too, none of which it imports. Its rooms are segmentation and, below it, fitting.
"""

import importlib
from typing import TYPE_CHECKING, Any

from features.config import ExtractionConfig
from features.errors import CwlfError, DegenerateSegmentError, ScanFormatError
from features.feature import Corner, Corners, Features, Line, LineForm, Lines
from features.scan import LaserScan
from features.sensor import SENSOR_PRESETS, Mounting, SensorModel, sensor_preset
from features.signature import Kind, Signatures

if TYPE_CHECKING:
    from features.extraction import extract
    from features.fitting.corner import intersect
    from features.fitting.line_fit import fit_cwlf, fit_line

__all__ = [
    "SENSOR_PRESETS",
    "Corner",
    "Corners",
    "CwlfError",
    "DegenerateSegmentError",
    "ExtractionConfig",
    "Features",
    "Kind",
    "LaserScan",
    "Line",
    "LineForm",
    "Lines",
    "Mounting",
    "ScanFormatError",
    "SensorModel",
    "Signatures",
    "extract",
    "fit_cwlf",
    "fit_line",
    "intersect",
    "sensor_preset",
]

_COMPILED = {
    "extract": "features.extraction",
    "fit_cwlf": "features.fitting.line_fit",
    "fit_line": "features.fitting.line_fit",
    "intersect": "features.fitting.corner",
}


def __getattr__(name: str) -> Any:
    # Loaded on first use: importing them compiles, and a program that only needs a value of the package must not wait.
    if name not in _COMPILED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_COMPILED[name]), name)
