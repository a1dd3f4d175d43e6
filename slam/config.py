"""The configuration of a run: defaults in code, TOML in and out."""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from features.config import ExtractionConfig
from features.sensor import Mounting, SensorModel, sensor_preset
from slam.errors import ConfigError

REASONS = {"extra_forbidden": "no such key", "model_type": "expected a table"}
"""What pydantic says in its own terms, in those of the user, by its type of error."""


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
        default=0.5, ge=0.0, description="nearest landmark of the same kind to a new one [m]"
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
        default=20.0,
        ge=0.0,
        description="how far apart a corner lies as seen from different key frames, beyond its covariance [mm]",
    )
    max_iterations: int = Field(default=100, ge=1, description="iterations of the batch solve at most")


class LoopConfig(_Section):
    """Loop closing."""

    enabled: bool = Field(default=True, description="recognise places that were seen before")
    apart_m: float = Field(default=15.0, gt=0.0, description="way between two visits of a place [m]")
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


def load_config(
    path: Path | None,
    *,
    preset: str | None = None,
    source_preset: str = "sick-lms",
    source_mounting: Mounting = Mounting(),  # noqa: B008, frozen
    seed: int | None = None,
) -> SlamConfig:
    """Put a configuration together: the sensor preset, over it the TOML file, over it what the caller names.

    Parameters
    ----------
    path : TOML file with any subset of the keys; None for the defaults.
    preset : sensor that the user asked for; None to take the file's, else the source's.
    source_preset, source_mounting : what the source says of its sensor.
    seed : overrides the file's.

    Raises
    ------
    ConfigError
        The file cannot be read, a key is unknown, a value is out of its limits or contradicts another.
    """
    given: dict[str, Any] = _read_toml(path) if path else {}
    where = f"{path}: " if path else ""
    sensor = given.get("sensor", {})
    if not isinstance(sensor, dict):
        raise ConfigError(f"{where}sensor: expected a table [sensor]")
    file_preset = sensor.get("preset")
    if not isinstance(file_preset, str | None):
        raise ConfigError(f"{where}sensor.preset: {file_preset!r}: expected the name of a sensor")
    if preset is not None and file_preset is not None and preset != file_preset:
        raise ConfigError(f"{where}sensor.preset is {file_preset!r} but the sensor asked for is {preset!r}: drop one")
    chosen = next(name for name in (preset, file_preset, source_preset) if name is not None)
    try:
        base = SlamConfig.of_preset(chosen, source_mounting).model_dump()
        merged = _overlay(base, given)
        if seed is not None:
            merged["seed"] = seed
        return SlamConfig.model_validate(merged)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        reason = REASONS.get(first["type"], first["msg"].removeprefix("Value error, "))
        raise ConfigError(f"{where}{key}: {reason}") from None
    except ValueError as error:
        raise ConfigError(f"{where}sensor.preset: {error}") from None


def to_toml(config: SlamConfig) -> str:
    """Write a configuration as TOML, each value with its meaning and unit beside it."""
    document = tomlkit.document()
    fill_table(document, config)
    return tomlkit.dumps(document)


def fill_table(table: Any, section: BaseModel) -> None:
    """Put each value of a section into a table of TOML, with its meaning and unit beside it."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            nested = tomlkit.table()
            fill_table(nested, value)
            table.add(name, nested)
        else:
            item = tomlkit.item(value)
            if field.description:
                item.comment(field.description)
            table.add(name, item)


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: not a text file: expected TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: not valid TOML: {error}") from None


def _overlay(base: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in given.items():
        below = merged.get(key)
        merged[key] = _overlay(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged
