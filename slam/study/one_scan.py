"""What the extractor sees in one scan of a log."""

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LogFormatError
from drivers.frame import FrameSource
from features import Features, LaserScan, extract
from slam.config import SlamConfig


def scan_features(source: FrameSource, number: int, config: SlamConfig) -> tuple[LaserScan, Features]:
    """Scan of a source by its number, from 0, and its lines and corners, sensor frame.

    Raises
    ------
    LogFormatError
        The source has fewer scans.
    CwlfError
        What comes before the scan is damaged.
    """
    count = 0
    for frame in source:
        if frame.scan is None:
            continue
        if count == number:
            return frame.scan, extract(frame.scan, config.sensor.model(), config.extraction)
        count += 1
    raise LogFormatError(f"{source.name}: there is no scan {number}: the log has {count}, 0 to {count - 1}")


def feature_lines(scan: LaserScan, features: Features) -> list[str]:
    """Lay lines and corners out for a terminal, sensor frame."""
    lines, corners = features.lines, features.corners
    text = [f"stamp {scan.stamp:.6f}, {len(scan)} beams, {len(lines)} lines, {len(corners)} corners (sensor frame)"]
    if len(lines):
        text.append(f"{'line':>6}{'points':>8}{'length [m]':>12}{'from [m]':>18}{'to [m]':>18}")
    for number, line in enumerate(lines):
        length = float(np.hypot(*(line.end - line.start)))
        text.append(f"{number:>6}{line.count:>8}{length:>12.3f}{_point(line.start)}{_point(line.end)}")
    if len(corners):
        text.append(f"{'corner':>6}{'position [m]':>20}{'sigma x / y [mm]':>19}{'opening [deg]':>15}  kind")
    for number, corner in enumerate(corners):
        sigma = 1e3 * np.sqrt(np.diag(corner.cov))
        text.append(
            f"{number:>6}  {_point(corner.position)}{f'{sigma[0]:.1f} / {sigma[1]:.1f}':>19}"
            f"{np.degrees(corner.opening_angle):>15.1f}  {'convex' if corner.convex else 'concave'}"
        )
    return text


def _point(point: NDArray[np.float64]) -> str:
    return f"{f'{point[0]:.3f}, {point[1]:.3f}':>18}"
