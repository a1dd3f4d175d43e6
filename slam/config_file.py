"""The configuration of a run as TOML: read, put together and written."""

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeGuard

import tomlkit
from pydantic import BaseModel, ValidationError

from drivers.frame import SourceInfo
from features.config import ExtractionConfig
from slam.config import SlamConfig
from slam.errors import ConfigError

REASONS = {"extra_forbidden": "no such key", "model_type": "expected a table"}
"""Messages for the user by pydantic's type of error."""


NO_SOURCE = SourceInfo("", "sick-lms")
"""For a configuration that is not for a certain source."""


def load_config(
    path: Path | None,
    *,
    preset: str | None = None,
    source: SourceInfo = NO_SOURCE,
    seed: int | None = None,
) -> SlamConfig:
    """Put a configuration together: the sensor preset, over it the TOML file, over it what the caller names.

    A file that sets ``sensor.sigma_range_mm`` and not ``sensor.noise`` means this noise, and none that is measured.

    Parameters
    ----------
    path : TOML file with any subset of the keys; None for the defaults.
    preset : sensor that the user asked for; None to take the file's, else the source's.
    source : what the source of the frames knows of its sensor; without odometry, ``odometry.source`` is ``lines``.
    seed : overrides the file's.

    Raises
    ------
    ConfigError
        The file cannot be read, a key is unknown, a value is out of its limits or contradicts another, or the odometry
        that it asks for is not there.
    """
    given: dict[str, Any] = _read_toml(path) if path else {}
    where = f"{path}: " if path else ""
    sensor = given.get("sensor", {})
    if not _is_table(sensor):
        raise ConfigError(f"{where}sensor: expected a table [sensor]")
    file_preset = sensor.get("preset")
    if not isinstance(file_preset, str | None):
        raise ConfigError(f"{where}sensor.preset: {file_preset!r}: expected the name of a sensor")
    if preset is not None and file_preset is not None and preset != file_preset:
        raise ConfigError(f"{where}sensor.preset is {file_preset!r} but the sensor asked for is {preset!r}: drop one")
    chosen = next(name for name in (preset, file_preset, source.sensor) if name is not None)
    try:
        base = SlamConfig.of_preset(chosen, source.mounting).model_dump()
        if _extraction_preset(given) == "paper":
            base["extraction"] = ExtractionConfig(preset="paper").model_dump()
        if not source.has_odometry:
            base["odometry"]["source"] = "lines"
        if "sigma_range_mm" in sensor:
            base["sensor"]["noise"] = "given"
        merged = _overlay(base, given)
        if seed is not None:
            merged["seed"] = seed
        config = SlamConfig.model_validate(merged)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        reason = REASONS.get(first["type"], first["msg"].removeprefix("Value error, "))
        raise ConfigError(f"{where}{key}: {reason}") from None
    except ValueError as error:
        raise ConfigError(f"{where}sensor.preset: {error}") from None
    if not source.has_odometry and config.odometry.source != "lines":
        raise ConfigError(
            f'{where}odometry.source is "{config.odometry.source}" but the log has no odometry: expected "lines"'
        )
    return config


def check_same(before: SlamConfig, now: SlamConfig, whose: str) -> None:
    """Refuse a configuration that is not that of ``whose`` run.

    Raises
    ------
    ConfigError
        A value differs; the message names the first.
    """
    pairs = zip(_leaves(before.model_dump()), _leaves(now.model_dump()), strict=True)
    for (key, was), (_, wanted) in pairs:
        if was != wanted:
            raise ConfigError(f"{whose} has {key} = {was!r}, not {wanted!r}; leave the configuration to it")


def _leaves(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if _is_table(value):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def to_toml(config: SlamConfig) -> str:
    """Write a configuration as TOML, each value with its meaning and unit beside it."""
    document = tomlkit.document()
    fill_table(document, config)
    return tomlkit.dumps(document)


def fill_table(table: Any, section: BaseModel) -> None:
    """Put each value of a section into a table of TOML, with its meaning and unit beside it."""
    for name, field in type(section).model_fields.items():
        value: object = getattr(section, name)
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


def _extraction_preset(given: dict[str, Any]) -> Any:
    extraction = given.get("extraction")
    return extraction.get("preset") if _is_table(extraction) else None


def _overlay(base: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in given.items():
        below = merged.get(key)
        merged[key] = _overlay(below, value) if _is_table(below) and _is_table(value) else value
    return merged


def _is_table(value: object) -> TypeGuard[dict[str, Any]]:
    """Whether a value of TOML is a table, whose keys are text."""
    return isinstance(value, dict)
