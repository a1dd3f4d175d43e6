"""Rules of the extraction, with their defaults."""

import math
import warnings
from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from features.se2 import Array

Covariance = Literal["propagated", "paper"]
"""How the covariance of a line is computed: ``paper`` by eq. 31-32, ``propagated`` from the noise of every point."""


LineFit = Literal["effective-variance", "cwlf", "arras-siegwart", "total-least-squares"]
"""Line fits; the first is the default, docs/math.md says why."""

METHODS: tuple[tuple[LineFit, Covariance], ...] = (
    ("cwlf", "paper"),
    ("cwlf", "propagated"),
    ("arras-siegwart", "propagated"),
    ("effective-variance", "propagated"),
    ("total-least-squares", "propagated"),
)
"""Line fits, each with a form of the covariance; compiled kernels take a method as its index in this tuple."""


REMOVED = "corner_gap_mm"
"""Key that is accepted with a warning."""

PAPER: Mapping[str, Any] = MappingProxyType(
    {
        "fit": "cwlf",
        "covariance": "paper",
        "split_distance_mm": 50.0,
        "split_sigmas": 0.0,
        "trim_points": 0,
        "trim_sigmas": 0.0,
        "tested": False,
    }
)
"""What ``preset = "paper"`` sets."""


class ExtractionConfig(BaseModel):
    """Parameters of the extraction: what counts as a segment, as a line and as a corner."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    preset: Literal["default", "paper"] = Field(
        default="default",
        description="default, or paper: its pipeline, where no other key says otherwise: split at 50 mm, CWLF with eq. "
        "31-32, and the intersection of each two neighbours, without the tests of lines and corners",
    )
    fit: LineFit = Field(
        default="effective-variance",
        description="line fit: effective-variance, cwlf (the paper's), arras-siegwart or total-least-squares",
    )
    covariance: Covariance = Field(
        default="propagated", description="covariance of lines and corners: propagated or paper"
    )
    jump_angle_deg: float = Field(
        default=5.0, gt=0.0, lt=90.0, description="flattest wall that is still followed from beam to beam [deg]"
    )
    gap_beams: float = Field(default=3.5, gt=1.0, description="a gap of more beam spacings than this ends a segment")
    split_distance_mm: float = Field(default=50.0, gt=0.0, description="floor of the IEPF threshold [mm]")
    split_sigmas: float = Field(default=5.0, ge=0.0, description="IEPF threshold in standard deviations of a range")
    trim_points: int = Field(default=1, ge=0, description="points left out at each end of a segment")
    trim_sigmas: float = Field(
        default=2.0,
        ge=0.0,
        description="points so near to the end of a segment are left out too, in standard deviations of a range",
    )
    min_points: int = Field(default=5, ge=2, description="least number of points of a line after trimming")
    min_length_m: float = Field(default=0.25, gt=0.0, description="least length of a line after trimming [m]")
    min_length_sigmas: float = Field(
        default=12.5, gt=0.0, description="least length in standard deviations of a range, where that is shorter"
    )
    corner_angle_min_deg: float = Field(default=30.0, gt=0.0, lt=180.0, description="sharpest corner [deg]")
    corner_angle_max_deg: float = Field(default=150.0, gt=0.0, lt=180.0, description="bluntest corner [deg]")
    tested: bool = Field(
        default=True, description="whether neighbours are merged and breaks moved, and lines and corners are tested"
    )
    straight_level: float = Field(
        default=0.01, gt=0.0, lt=1.0, description="probability that chance splits a straight wall in two"
    )
    bend_sigmas: float = Field(
        default=2.0, ge=0.0, description="a wall may be bent where its curvature is beyond so many standard deviations"
    )
    near_sigmas: float = Field(
        default=4.0, gt=0.0, description="a point between two walls is of one within so many standard deviations of it"
    )
    end_sigmas: float = Field(
        default=2.0, ge=0.0, description="noise moves the last point of a wall by so many standard deviations along it"
    )
    corner_level: float = Field(
        default=0.05, gt=0.0, lt=1.0, description="probability that chance makes a wall end before a corner"
    )
    unseen_end: float = Field(
        default=0.05, ge=0.0, lt=1.0, description="probability that a wall ends between its last beam and a corner"
    )

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        given = dict(cast("dict[str, Any]", values))
        if given.pop(REMOVED, None) is not None:
            warnings.warn(
                f"extraction.{REMOVED} is not used any more: how far a wall may end from its corner follows from the "
                "spacing of its beams; remove it",
                DeprecationWarning,
                stacklevel=2,
            )
        return {**PAPER, **given} if given.get("preset") == "paper" else given

    @model_validator(mode="after")
    def _consistent(self) -> "ExtractionConfig":
        if self.corner_angle_min_deg >= self.corner_angle_max_deg:
            raise ValueError(
                f"corner_angle_min_deg {self.corner_angle_min_deg:g} must be below "
                f"corner_angle_max_deg {self.corner_angle_max_deg:g}"
            )
        if (self.fit, self.covariance) not in METHODS:
            raise ValueError(f'covariance "paper" (eq. 31-32) belongs to fit "cwlf", not to {self.fit!r}')
        return self

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> "ExtractionConfig":
        """Copy, with some values changed; the rules of the copy are its own."""
        copy = super().model_copy(update=update, deep=deep)
        vars(copy).pop("rules", None)
        return copy

    @cached_property
    def rules(self) -> Array:
        """The numbers of :class:`Rules`, as the compiled kernel takes them."""
        rules = Rules(
            jump_angle=math.radians(self.jump_angle_deg),
            gap_beams=self.gap_beams,
            split_distance=self.split_distance_mm * 1e-3,
            split_sigmas=self.split_sigmas,
            trim_points=self.trim_points,
            trim_sigmas=self.trim_sigmas,
            min_points=self.min_points,
            min_length=self.min_length_m,
            min_length_sigmas=self.min_length_sigmas,
            corner_angle_min=math.radians(self.corner_angle_min_deg),
            corner_angle_max=math.radians(self.corner_angle_max_deg),
            straight_level=self.straight_level,
            bend_sigmas=self.bend_sigmas,
            near_sigmas=self.near_sigmas,
            end_sigmas=self.end_sigmas,
            corner_level=self.corner_level,
            unseen_end=self.unseen_end,
            tested=int(self.tested),
            method=METHODS.index((self.fit, self.covariance)),
        )
        return np.array(rules, dtype=np.float64)


class Rules(NamedTuple):
    """:class:`ExtractionConfig` in SI units [m, rad]; the method is its index in :data:`METHODS`."""

    jump_angle: float
    gap_beams: float
    split_distance: float
    split_sigmas: float
    trim_points: int
    trim_sigmas: float
    min_points: int
    min_length: float
    min_length_sigmas: float
    corner_angle_min: float
    corner_angle_max: float
    straight_level: float
    bend_sigmas: float
    near_sigmas: float
    end_sigmas: float
    corner_level: float
    unseen_end: float
    tested: int
    method: int
