"""Time and uncertainty of a corner, step by step: the data of the paper's Fig. 3, 4 and 5."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from features.se2 import Array, inverse, transform
from sim import (
    ENVIRONMENT_A_POSE,
    ENVIRONMENT_B_POSE,
    environment_a,
    environment_b,
    visible_corners,
    visible_sections,
)
from slam.study.paper import timing_kernels as kernels
from slam.study.paper.consistency import Scene, measure, noisy_walls
from slam.study.paper.corners import SHOWN
from slam.study.paper.methods import METHODS

FORMS: Mapping[str, tuple[str, int]] = {
    "cwlf": ("CWLF", kernels.CWLF),
    "arras-siegwart": ("Arras-Siegwart, single sums", kernels.ARRAS_SIEGWART),
    "arras-siegwart-literal": ("Arras-Siegwart, eq. 17 as printed", kernels.ARRAS_SIEGWART_LITERAL),
}
"""What is timed: label and number for the compiled functions."""

STEPS = ("line parameters", "line uncertainty", "corner", "corner uncertainty")

COUNTS = (10, 20, 30, 50, 70, 90, 100, 150, 200, 300, 500, 700, 1000)
"""Measurements of a corner in the counterpart of Fig. 3, half of them on each wall."""

FIGURE_COUNTS = 50, 100
"""The same in the counterparts of Fig. 4 and 5."""

TRIALS = 1000
"""Noisy corners behind a true RMS error."""


class TimingSettings(BaseModel):
    """What a study of timing depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    repeats: int = Field(default=7, ge=1, description="times each figure is taken; the least one counts")
    lot_ms: float = Field(default=3.0, gt=0.0, description="a figure is the mean over a run at least so long [ms]")
    sigma_range_mm: float = Field(default=50.0, gt=0.0, description="standard deviation of a range [mm]")
    sigma_bearing_deg: float = Field(
        default=round(0.391 / math.sqrt(12.0), 6), gt=0.0, description="standard deviation of a beam's direction [deg]"
    )
    seed: int = Field(default=1, ge=0, description="of the noise of the measurements")


def paper_corner(environment: str, settings: TimingSettings, points: int) -> Scene:
    """Corner 20 of environment A (130 deg) or 4 of B (90 deg), seen from the environment's pose.

    Both walls are as long as the shorter one is seen, and hold ``points`` measurements together.
    """
    world, sensor, number = {
        "A": (environment_a(), ENVIRONMENT_A_POSE, 20),
        "B": (environment_b(), ENVIRONMENT_B_POSE, 4),
    }[environment]
    corner = int(visible_corners(world, sensor, *SHOWN)[number - 1])
    sections = visible_sections(world, sensor)
    ids = world.corner_walls[corner]
    position = transform(inverse(sensor), world.corners[corner])
    bearing = math.atan2(position[1], position[0])
    incidence = 0.0
    for wall in ids:
        ends = transform(inverse(sensor), world.walls[wall].reshape(2, 2))
        far = ends[np.hypot(*(ends - position).T).argmax()] - position
        cross, dot = -position[0] * far[1] + position[1] * far[0], -position @ far
        if cross < 0.0:  # the wall to the left of the line of sight
            incidence = math.degrees(math.atan2(-cross, dot))
    return Scene(
        sigma_range_mm=settings.sigma_range_mm,
        sigma_bearing_deg=settings.sigma_bearing_deg,
        spacing_deg=0.391,
        wall_m=min(float(sections.lengths[sections.wall_ids == wall].max()) for wall in ids),
        distance_m=float(np.hypot(*position)),
        corner_angle_deg=float(np.degrees(world.opening_angles[corner])),
        incidence_deg=incidence,
        points=points // 2,
        bearing_deg=math.degrees(bearing),
    )


def measurements(scene: Scene, seed: int) -> tuple[Array, Array]:
    """One noisy take of each wall of a scene: rows x, y [m], range [m] and angle [rad], shape (4, n)."""
    first, second = (
        np.ascontiguousarray(np.vstack([ranges[0] * np.cos(angles), ranges[0] * np.sin(angles), ranges[0], angles]))
        for ranges, angles in noisy_walls(scene, 1, np.random.default_rng(seed))
    )
    return first, second


def time_steps(scene: Scene, settings: TimingSettings, form: str) -> Array:
    """Time of each of :data:`STEPS` alone and, last, of all of them together, shape (5,) [us].

    It is the processor's time of this thread, which what else the machine does does not lengthen.
    """
    first, second = measurements(scene, settings.seed)
    variances = (1e-3 * scene.sigma_range_mm) ** 2, math.radians(scene.sigma_bearing_deg) ** 2
    space = np.zeros((2, 8)), np.zeros((2, 3)), np.zeros(2), np.zeros(3)
    number, last = FORMS[form][1], len(STEPS) - 1
    spans = [*((step, step) for step in range(len(STEPS))), (0, last)]

    def lot(span: tuple[int, int], times: int) -> float:
        began = time.thread_time()
        kernels.run_steps(number, *span, times, first, second, *variances, *space)
        return 1e6 * (time.thread_time() - began) / times

    lot((0, last), 1)
    once = [min(lot(span, 1) for _ in range(3)) for span in spans]
    times = [max(1, math.ceil(1e3 * settings.lot_ms / taken)) for taken in once]
    # The steps take turns, so that a slow moment of the machine falls on all of them.
    taken = [[lot(span, many) for span, many in zip(spans, times, strict=True)] for _ in range(settings.repeats)]
    return np.min(taken, axis=0)


def figure_3_rows(
    settings: TimingSettings, progress: Callable[[float, int], None] = lambda share, corners: None
) -> list[dict[str, Any]]:
    """One row per number of measurements: time of a corner with its uncertainty, by each form, and the ratios [us]."""
    rows: list[dict[str, Any]] = []
    for done, count in enumerate(COUNTS, start=1):
        scene = paper_corner("A", settings, count)
        taken = {form: float(time_steps(scene, settings, form)[-1]) for form in FORMS}
        rows.append(
            {"measurements": count}
            | {f"{form.replace('-', '_')}_us": value for form, value in taken.items()}
            | {
                "ratio_single_sums": taken["arras-siegwart"] / taken["cwlf"],
                "ratio_as_printed": taken["arras-siegwart-literal"] / taken["cwlf"],
            }
        )
        progress(done / len(COUNTS), done)
    return rows


def step_rows(settings: TimingSettings) -> list[dict[str, Any]]:
    """One row per corner of Fig. 4 and 5, number of measurements, form and step: time of the step alone [us]."""
    rows: list[dict[str, Any]] = []
    for environment in "AB":
        for count in FIGURE_COUNTS:
            scene = paper_corner(environment, settings, count)
            for form in FORMS:
                alone = time_steps(scene, settings, form)[:-1]
                for step, value in zip(STEPS, alone, strict=True):
                    rows.append(
                        {
                            "environment": environment,
                            "measurements": count,
                            "form": form,
                            "step": step,
                            "time_us": float(value),
                            "share": float(value / alone.sum()),
                        }
                    )
    return rows


def uncertainty_rows(settings: TimingSettings) -> list[dict[str, Any]]:
    """One row per corner of Fig. 4 and 5, number of measurements and method: claimed sigma, true RMS error [mm]."""
    rows: list[dict[str, Any]] = []
    for environment in "AB":
        for count in FIGURE_COUNTS:
            scene = paper_corner(environment, settings, count)
            for method in METHODS:
                result = measure(scene, TRIALS, np.random.default_rng(settings.seed), method)
                rows.append(
                    {
                        "environment": environment,
                        "corner_angle_deg": round(scene.corner_angle_deg, 1),
                        "measurements": count,
                        "method": method.key,
                    }
                    | {name: result[name] for name in ("sigma_x_mm", "sigma_y_mm", "rms_x_mm", "rms_y_mm", "nees_half")}
                )
    return rows


def timing_lines(
    curve: Sequence[Mapping[str, Any]], steps: Sequence[Mapping[str, Any]], uncertainty: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Lay the figures out for a terminal."""
    lines = [f"{'measurements':>12}{'CWLF':>11}{'A-S':>11}{'A-S printed':>15}{'A-S/CWLF':>10}{'printed/CWLF':>14}"]
    lines += [
        f"{row['measurements']:>12}{row['cwlf_us']:>8.2f} us{row['arras_siegwart_us']:>8.2f} us"
        f"{row['arras_siegwart_literal_us']:>12.1f} us{row['ratio_single_sums']:>10.2f}{row['ratio_as_printed']:>14.0f}"
        for row in curve
    ]
    lines.append("")
    for environment, number in (("A", 20), ("B", 4)):
        for count in FIGURE_COUNTS:
            for form, (label, _) in FORMS.items():
                mine = [
                    row
                    for row in steps
                    if (row["environment"], row["measurements"], row["form"]) == (environment, count, form)
                ]
                parts = ", ".join(f"{row['step']} {row['time_us']:.2f}" for row in mine)
                lines.append(f"{environment} corner {number}, {count} measurements, {label} [us]: {parts}")
    lines.append("")
    lines += [
        f"{row['environment']} {row['corner_angle_deg']:g} deg, {row['measurements']:>3} measurements, "
        f"{row['method']:<20} claims {row['sigma_x_mm']:>5.1f} /{row['sigma_y_mm']:>5.1f} mm, errs "
        f"{row['rms_x_mm']:>5.1f} /{row['rms_y_mm']:>5.1f} mm, NEES/2 {row['nees_half']:.2f}"
        for row in uncertainty
    ]
    return lines
