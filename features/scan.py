"""One revolution or sweep of a 2D laser scanner."""

import math
from dataclasses import dataclass

import numpy as np

from features.errors import ScanFormatError
from features.se2 import Array


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """Ranges and the angle of each beam, sensor frame.

    Parameters
    ----------
    ranges : shape (n,) [m]. Infinity, or a value outside the sensor's range limits such as 0, is no return.
    angles : shape (n,) [rad], counter-clockwise from the sensor's x axis, stored per beam.
    stamp : time of the scan [s].
    times : time of each beam after the stamp, shape (n,) [s]; negative before it. None where all beams were taken at
        once or their times are not known.

    Raises
    ------
    ScanFormatError
        Shapes differ, a range is NaN or negative, an angle, the stamp or a time is not finite.
    """

    ranges: Array
    angles: Array
    stamp: float = 0.0
    times: Array | None = None

    def __post_init__(self) -> None:
        ranges = np.ascontiguousarray(self.ranges, dtype=np.float64)
        angles = np.ascontiguousarray(self.angles, dtype=np.float64)
        if ranges.ndim != 1 or ranges.shape != angles.shape:
            raise ScanFormatError(f"a scan needs one angle per range: {ranges.shape} ranges, {angles.shape} angles")
        usable = ranges >= 0.0
        if not usable.all():
            beam = int(usable.argmin())
            raise ScanFormatError(f"range of beam {beam} is {ranges[beam]:g}: expected metres, or inf for no return")
        finite = np.isfinite(angles)
        if not finite.all():
            beam = int(finite.argmin())
            raise ScanFormatError(f"angle of beam {beam} is {angles[beam]:g}: expected radians")
        if not math.isfinite(self.stamp):
            raise ScanFormatError(f"stamp is {self.stamp:g}: expected seconds")
        if self.times is not None:
            times = np.ascontiguousarray(self.times, dtype=np.float64)
            if times.shape != ranges.shape:
                raise ScanFormatError(f"a scan needs one time per range: {ranges.shape} ranges, {times.shape} times")
            if not np.isfinite(times).all():
                beam = int((~np.isfinite(times)).argmax())
                raise ScanFormatError(f"time of beam {beam} is {times[beam]:g}: expected seconds from the stamp on")
            object.__setattr__(self, "times", times)
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "angles", angles)

    def __len__(self) -> int:
        return self.ranges.size
