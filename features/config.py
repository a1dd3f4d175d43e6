"""Rules of the extraction, with their defaults."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Covariance = Literal["propagated", "paper"]
"""Form of the line covariance: ``paper`` is eq. 31-32, ``propagated`` carries each point's whole variance."""


class ExtractionConfig(BaseModel):
    """What counts as a segment, a line and a corner."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    covariance: Covariance = Field(
        default="propagated", description="covariance of lines and corners: propagated or paper"
    )
    jump_angle_deg: float = Field(
        default=10.0, gt=0.0, lt=90.0, description="flattest wall that is still followed from beam to beam [deg]"
    )
    gap_beams: float = Field(default=3.5, gt=1.0, description="a gap of more beam spacings than this ends a segment")
    split_distance_mm: float = Field(default=50.0, gt=0.0, description="floor of the IEPF threshold [mm]")
    split_sigmas: float = Field(default=5.0, gt=0.0, description="IEPF threshold in standard deviations of a range")
    trim_points: int = Field(default=1, ge=0, description="points at each end of a segment that belong to neither wall")
    trim_sigmas: float = Field(
        default=4.0,
        ge=0.0,
        description="points nearer to the end of a segment than this, in standard deviations of a range, too",
    )
    min_points: int = Field(default=5, ge=2, description="points of a line after trimming")
    min_length_m: float = Field(default=0.25, gt=0.0, description="length of a line after trimming [m]")
    corner_angle_min_deg: float = Field(default=30.0, gt=0.0, lt=180.0, description="sharpest corner [deg]")
    corner_angle_max_deg: float = Field(default=150.0, gt=0.0, lt=180.0, description="bluntest corner [deg]")
    corner_gap_mm: float = Field(
        default=100.0, gt=0.0, description="how far walls may end from their intersection, beyond the beam spacing [mm]"
    )

    @model_validator(mode="after")
    def _ordered(self) -> "ExtractionConfig":
        if self.corner_angle_min_deg >= self.corner_angle_max_deg:
            raise ValueError(
                f"corner_angle_min_deg {self.corner_angle_min_deg:g} must be below "
                f"corner_angle_max_deg {self.corner_angle_max_deg:g}"
            )
        return self
