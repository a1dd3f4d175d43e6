"""Lines and corners of 2D laser scans, with covariances (CWLF).

The package promises :func:`extract` and the values that it takes and gives; ``features.se2`` and ``features.signature``
serve the other packages too, none of which it imports. Its rooms are segmentation and, below it, fitting.
"""

from features.config import ExtractionConfig
from features.errors import CwlfError, DegenerateSegmentError, ScanFormatError
from features.extract import extract
from features.feature import Corner, Corners, Features, Line, LineForm, Lines
from features.fitting.corner import intersect
from features.fitting.line_fit import fit_cwlf, fit_line
from features.scan import LaserScan
from features.sensor import SENSOR_PRESETS, Mounting, SensorModel, sensor_preset
from features.signature import Kind, Signatures

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
