"""The configuration of a run: its sections, their defaults and limits."""

import math
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from features.config import ExtractionConfig
from features.sensor import Mounting, SensorModel, sensor_preset


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class MountingConfig(_Section):
    """Pose of the sensor on the robot."""

    x_m: float = Field(default=0.0, description="forward of the robot's centre [m]")
    y_m: float = Field(default=0.0, description="to the left of the robot's centre [m]")
    yaw_deg: float = Field(default=0.0, description="direction of the sensor's x axis [deg]")
    upside_down: bool = Field(default=False, description="the sensor hangs with its face down")

    @classmethod
    def of(cls, mounting: Mounting) -> "MountingConfig":
        """Express a mounting in the units of the configuration."""
        return cls(
            x_m=mounting.x, y_m=mounting.y, yaw_deg=math.degrees(mounting.theta), upside_down=mounting.upside_down
        )

    def mounting(self) -> Mounting:
        """Mounting in SI units."""
        return Mounting(self.x_m, self.y_m, math.radians(self.yaw_deg), self.upside_down)


class SensorConfig(_Section):
    """Noise of a single beam, limits and mounting."""

    preset: str = Field(description="sensor that the values below started from")
    noise: Literal["measured", "given"] = Field(
        default="given",
        description="measured: sigma_range_mm and range_max_m are what the run starts with, until its scans show them; "
        "given: they stay, and a run that contradicts them says so",
    )
    sigma_range_mm: float = Field(gt=0.0, description="standard deviation of a range [mm]")
    sigma_bearing_deg: float = Field(gt=0.0, description="standard deviation of the direction of a beam [deg]")
    range_min_m: float = Field(ge=0.0, description="a shorter range is no return [m]")
    range_max_m: float = Field(gt=0.0, description="a longer range is no return [m]")
    mounting: MountingConfig = MountingConfig()

    @classmethod
    def of_preset(cls, preset: str, mounting: Mounting) -> "SensorConfig":
        """Express a preset in the units of the configuration; ValueError where there is none of this name."""
        model = sensor_preset(preset)
        return cls(
            preset=preset,
            noise="measured",
            sigma_range_mm=model.sigma_range * 1e3,
            sigma_bearing_deg=math.degrees(model.sigma_bearing),
            range_min_m=model.range_min,
            range_max_m=model.range_max,
            mounting=MountingConfig.of(mounting),
        )

    def model(self) -> SensorModel:
        """Sensor model in SI units."""
        return SensorModel(
            sigma_range=self.sigma_range_mm * 1e-3,
            sigma_bearing=math.radians(self.sigma_bearing_deg),
            range_min=self.range_min_m,
            range_max=self.range_max_m,
            mounting=self.mounting.mounting(),
        )

    @model_validator(mode="after")
    def _ordered(self) -> "SensorConfig":
        if self.range_min_m >= self.range_max_m:
            raise ValueError(f"range_min_m {self.range_min_m:g} must be below range_max_m {self.range_max_m:g}")
        return self


OdometrySource = Literal["line-aided", "lines", "wheel"]
"""What the motion is taken from: wheels and scans, scans alone, wheels alone."""


class OdometryConfig(_Section):
    """Where the motion comes from; random walk of the wheels, each variance in proportion to the motion."""

    source: OdometrySource = Field(
        default="line-aided",
        description="line-aided: wheels, corrected by each scan; lines: scans without wheels; wheel: wheels alone",
    )
    key_frames: int = Field(default=30, ge=1, description="key frames whose walls a scan is registered to")
    position_per_travel: float = Field(default=0.05, gt=0.0, description="sigma of position after 1 m [m]")
    position_per_turn: float = Field(default=0.03, gt=0.0, description="sigma of position after a turn of 1 rad [m]")
    heading_per_travel_deg: float = Field(default=3.0, gt=0.0, description="sigma of heading after 1 m [deg]")
    heading_per_turn_deg: float = Field(default=6.0, gt=0.0, description="sigma of heading after a turn of 1 rad [deg]")
    speed_m_s: float = Field(
        default=1.0,
        gt=0.0,
        description="sigma of the speed, of which nothing else is known; three times it, or the speed that the wheels "
        "have shown, bound what is taken for a jump of the wheels [m/s]",
    )
    turn_rate_deg_s: float = Field(
        default=60.0, gt=0.0, description="the same of the turn rate, also for jumps of the wheels [deg/s]"
    )
    speed_change_m_s: float = Field(
        default=0.5, gt=0.0, description="source lines: sigma of the change of the speed within 1 s [m/s]"
    )
    turn_rate_change_deg_s: float = Field(
        default=60.0, gt=0.0, description="source lines: sigma of the change of the turn rate within 1 s [deg/s]"
    )


class FrontEndConfig(_Section):
    """EKF and data association."""

    deskew: bool = Field(
        default=True, description="undo the motion during a scan by odometry, where the times of its beams are known"
    )
    update_distance_m: float = Field(
        default=0.1, ge=0.0, description="motion after which corners update the filter again [m]"
    )
    update_angle_deg: float = Field(
        default=3.0, ge=0.0, description="turn after which corners update the filter again [deg]"
    )
    use_identities: bool = Field(
        default=True, description="take the identities of observed landmarks, where the source knows them"
    )
    association: Literal["joint", "nearest"] = Field(
        default="joint", description="pairs by joint compatibility (JCBB), or nearest neighbour: joint or nearest"
    )
    keep_distance_m: float = Field(
        default=20.0, gt=0.0, description="landmarks farther from the robot than this leave the filter [m]"
    )
    match_probability: float = Field(
        default=0.99, gt=0.0, lt=1.0, description="chi-square level of the association gate"
    )
    birth_probability: float = Field(
        default=0.9999, gt=0.0, lt=1.0, description="chi-square level beyond which a corner is a new landmark"
    )
    birth_distance_m: float = Field(
        default=0.5, ge=0.0, description="least distance of a new landmark from any other of the same kind [m]"
    )
    opening_tolerance_deg: float = Field(
        default=20.0, gt=0.0, description="opening angles that may belong together [deg]"
    )
    orientation_tolerance_deg: float = Field(
        default=30.0, gt=0.0, description="orientations that may belong together [deg]"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "FrontEndConfig":
        if self.match_probability > self.birth_probability:
            raise ValueError(
                f"match_probability {self.match_probability:g} must not exceed "
                f"birth_probability {self.birth_probability:g}"
            )
        return self


class BackEndConfig(_Section):
    """Factor graph."""

    key_frame_distance_m: float = Field(default=0.3, gt=0.0, description="motion between key frames [m]")
    key_frame_angle_deg: float = Field(default=15.0, gt=0.0, description="turn between key frames [deg]")
    cauchy_scale: float = Field(
        default=2.0, gt=0.0, description="residual, in sigmas, where the robust kernel halves the weight of a corner"
    )
    corner_scatter_mm: float = Field(
        default=0.0,
        ge=0.0,
        description="standard deviation of a corner between key frames, beyond the sensor noise [mm]",
    )
    max_iterations: int = Field(default=100, ge=1, description="iterations of the batch solve at most")


class LoopConfig(_Section):
    """Loop closing."""

    enabled: bool = Field(default=True, description="recognise places that were seen before")
    apart_m: float = Field(default=15.0, gt=0.0, description="path length between two visits of a place [m]")
    reach_m: float = Field(default=5.0, gt=0.0, description="distance of key frames that may show the same place [m]")
    least_share: float = Field(
        default=0.6, gt=0.0, le=1.0, description="share of the points of a scan that must lie on walls seen before"
    )


class MapConfig(_Section):
    """What the map shows."""

    min_observations: int = Field(default=3, ge=1, description="times a landmark must have been observed")


class SlamConfig(_Section):
    """Everything a run depends on beside its data."""

    seed: int = Field(default=0, ge=0, description="seed of what is random in a run: the scan points drawn on the map")
    sensor: SensorConfig
    extraction: ExtractionConfig = ExtractionConfig()
    odometry: OdometryConfig = OdometryConfig()
    front_end: FrontEndConfig = FrontEndConfig()
    back_end: BackEndConfig = BackEndConfig()
    loop: LoopConfig = LoopConfig()
    map: MapConfig = MapConfig()

    @classmethod
    def of_preset(cls, preset: str, mounting: Mounting = Mounting()) -> "SlamConfig":  # noqa: B008, frozen
        """Defaults for a known sensor; ValueError where there is none of this name."""
        return cls(sensor=SensorConfig.of_preset(preset, mounting))


def without_identities(config: SlamConfig) -> SlamConfig:
    """Return a configuration that takes no identity of an observed landmark."""
    front_end = config.front_end.model_copy(update={"use_identities": False})
    return config.model_copy(update={"front_end": front_end})
