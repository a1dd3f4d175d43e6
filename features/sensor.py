"""The sensor: noise of a beam, range limits and mounting on the robot."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array, Pose, pose, wrap_angle


@dataclass(frozen=True, slots=True)
class Mounting:
    """Pose of the sensor on the robot, robot frame.

    Parameters
    ----------
    x, y : position of the sensor [m].
    theta : direction of the sensor's x axis [rad].
    upside_down : the sensor is mounted face down, so that its angles run clockwise seen from above.
    """

    x: float = 0.0
    y: float = 0.0
    theta: float = 0.0
    upside_down: bool = False

    @property
    def pose_robot_sensor(self) -> Pose:
        """Pose of the sensor in the robot frame; whether it is upside down is not in it."""
        return pose(self.x, self.y, self.theta)

    @property
    def axes(self) -> Array:
        """Matrix, shape (2, 2), from the sensor's directions to the robot's: a rotation, upside down a reflection."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return np.array([[c, s], [s, -c]]) if self.upside_down else np.array([[c, -s], [s, c]])

    def points_to_robot(self, points_sensor: Array) -> Array:
        """Points, shape (n, 2) or (2,) [m], of the sensor frame in the robot frame."""
        return points_sensor @ self.axes.T + np.array([self.x, self.y])

    def points_to_sensor(self, points_robot: Array) -> Array:
        """Points, shape (n, 2) or (2,) [m], of the robot frame in the sensor frame."""
        return (points_robot - np.array([self.x, self.y])) @ self.axes

    def direction_to_robot(self, angle: float) -> float:
        """Angle of a direction of the sensor frame in the robot frame [rad]."""
        return wrap_angle(self.theta + (-angle if self.upside_down else angle))


@dataclass(frozen=True, slots=True)
class SensorModel:
    """Noise of a single beam (eq. M1-M2, section III of the paper), range limits and mounting.

    Parameters
    ----------
    sigma_range : standard deviation of a range [m].
    sigma_bearing : standard deviation of the direction of a beam [rad].
    range_min, range_max : a range outside of them is no return [m].
    mounting : pose of the sensor on the robot.

    Raises
    ------
    ValueError
        A sigma is not positive, or the limits are not 0 <= range_min < range_max.
    """

    sigma_range: float
    sigma_bearing: float
    range_min: float
    range_max: float
    mounting: Mounting = field(default_factory=Mounting)

    def __post_init__(self) -> None:
        for name in ("sigma_range", "sigma_bearing"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} is {value:g}: a standard deviation must be positive and finite")
        if not 0.0 <= self.range_min < self.range_max:
            raise ValueError(
                f"range_min {self.range_min:g}, range_max {self.range_max:g}: expected 0 <= range_min < range_max"
            )

    def returned(self, ranges: Array) -> NDArray[np.bool_]:
        """Whether each range is a return: positive and within the limits [m]."""
        return (ranges > 0.0) & (ranges >= self.range_min) & (ranges <= self.range_max)


SENSOR_PRESETS: Mapping[str, SensorModel] = MappingProxyType(
    {
        # Data sheet +-50 mm, read as the 99 % band; an angle quantised to the beam spacing of 0.391 deg.
        "rplidar-s1": SensorModel(
            sigma_range=0.02, sigma_bearing=math.radians(0.391) / math.sqrt(12.0), range_min=0.1, range_max=40.0
        ),
        # Triangulating: 1 % of the range up to 3 m, read as the 99 % band there; worse than this at long range.
        # Angles quantised to the beam spacing at 10 Hz: 8,000 samples a second (A1, A2), 16,000 (A3).
        "rplidar-a1": SensorModel(
            sigma_range=0.012, sigma_bearing=math.radians(0.45) / math.sqrt(12.0), range_min=0.15, range_max=12.0
        ),
        "rplidar-a2": SensorModel(
            sigma_range=0.012, sigma_bearing=math.radians(0.45) / math.sqrt(12.0), range_min=0.2, range_max=16.0
        ),
        "rplidar-a3": SensorModel(
            sigma_range=0.012, sigma_bearing=math.radians(0.225) / math.sqrt(12.0), range_min=0.2, range_max=25.0
        ),
        # As the S1: +-30 mm, 32,000 samples a second.
        "rplidar-s2": SensorModel(
            sigma_range=0.012, sigma_bearing=math.radians(0.12) / math.sqrt(12.0), range_min=0.05, range_max=30.0
        ),
        # Ranges in whole centimetres with a statistical error of about one; 81.8 m and above are no return.
        "sick-lms": SensorModel(sigma_range=0.01, sigma_bearing=math.radians(0.1), range_min=0.05, range_max=80.0),
        # Camera of the MRCLAM data sets, which reads barcodes; its noise is not published. Errors of data set 6 against
        # its survey are 0.18 m and 0.010 rad (RMS); these values are larger, because the errors persist for seconds.
        "mrclam-camera": SensorModel(sigma_range=0.2, sigma_bearing=0.015, range_min=0.0, range_max=20.0),
    }
)
"""Sensor models by the names that the command line takes."""


def sensor_preset(name: str) -> SensorModel:
    """Return the model of a sensor by its name in :data:`SENSOR_PRESETS`.

    Raises
    ------
    ValueError
        No preset has this name.
    """
    if name not in SENSOR_PRESETS:
        raise ValueError(f"unknown sensor preset {name!r}: known are {', '.join(sorted(SENSOR_PRESETS))}")
    return SENSOR_PRESETS[name]
