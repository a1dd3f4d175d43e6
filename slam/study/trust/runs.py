"""Runs with and without faults through SLAM: how wrong each was, and what spoke against it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.stats import beta

from features.se2 import between
from slam.errors import DivergedError
from slam.pipeline import Slam
from slam.study.trust.faults import FAULTS, drawn_scene

WRONG = 0.5
"""A run is wrong whose position, in the frame of the start, is ever off by more [m]."""

ROOMS_OF_STUDY = 10_000
"""Rooms that are drawn for one study before those of the next seed begin."""


class TrustSettings(BaseModel):
    """What a study of trust depends on."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    runs: int = Field(default=200, ge=0, description="runs without fault")
    faulty: int = Field(default=200, ge=0, description="runs with one fault each, the faults by turns")
    scans: int = Field(default=120, ge=2, description="a run stops after so many scans")
    seed: int = Field(default=1, ge=0, description="of the study; those of the runs are made of it")


def run_task(settings: TrustSettings, task: int, seed: int) -> dict[str, Any]:
    """Do one run; the faulty ones come after those without fault."""
    fault = None if task < settings.runs else FAULTS[(task - settings.runs) % len(FAULTS)]
    scene = drawn_scene(ROOMS_OF_STUDY * settings.seed + task, fault, settings.scans, seed)
    slam = Slam(scene.config)
    diverged: float | None = None
    worst, final = float("inf"), float("inf")
    reasons: list[dict[str, Any]] = []
    try:
        for frame in scene.frames:
            slam.process(frame)
        result = slam.finish()
    except DivergedError:
        diverged = slam.stamp
    else:
        truth = scene.truth.at(np.clip(result.trajectory.stamps, scene.truth.stamps[0], scene.truth.stamps[-1]))
        estimated = result.trajectory.poses
        off = [
            np.hypot(*(between(estimated[0], pose) - between(truth[0], true))[:2])
            for pose, true in zip(estimated, truth, strict=True)
        ]
        worst, final = float(max(off)), float(off[-1])
        reasons = [
            {"what": reason.what, "stamp": reason.stamp, "until": reason.until}
            for reason in result.metrics.trust.reasons
        ]
    if diverged is not None:
        reasons = [{"what": "diverged", "stamp": diverged, "until": diverged}]
    first = min((reason["stamp"] for reason in reasons), default=None)
    # The stamp of a scan is that of the middle of its sweep, which may begin before the fault.
    sweep = 1.0 / scene.rate
    after = [reason["stamp"] for reason in reasons if reason["stamp"] > scene.begun - sweep]
    return {
        "run": task,
        "seed": seed,
        "world": scene.world,
        "scanner": scene.scanner,
        "effects": scene.effects,
        "odometry": scene.odometry,
        "fault": scene.fault,
        "begun_s": None if np.isnan(scene.begun) else scene.begun,
        "size": None if np.isnan(scene.size) else scene.size,
        "worst_m": None if diverged is not None else worst,
        "final_m": None if diverged is not None else final,
        "wrong": worst > WRONG,
        "trusted": not reasons,
        "alarm_s": first,
        "delay_s": max(min(after) - scene.begun, 0.0) if after and scene.fault != "none" else None,
        "reasons": reasons,
    }


def run_rows(results: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row per run; its reasons in one field, each with when it was noticed first and last [s]."""
    return [
        dict(result)
        | {
            "reasons": "; ".join(
                f"{reason['what']} {reason['stamp']:.3f} .. {reason['until']:.3f}" for reason in result["reasons"]
            )
        }
        for result in results
    ]


def share_interval(count: int, of: int, level: float = 0.95) -> tuple[float, float]:
    """Interval of Clopper and Pearson for a share of which ``count`` were seen in ``of`` independent cases."""
    tail = 0.5 * (1.0 - level)
    low = float(beta.ppf(tail, count, of - count + 1)) if count else 0.0
    high = float(beta.ppf(1.0 - tail, count + 1, of - count)) if count < of else 1.0
    return low, high


def trust_summary(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rates of the study.

    ``false_alarms``: runs without fault that are right, and the share of them that were not trusted; ``detected``: all
    runs that are wrong, and the share of them that were not trusted. The same by fault and by reason, and median of the
    delay from the begin of a fault to the first reason after it.
    """
    sound = [of for of in results if of["fault"] == "none" and not of["wrong"]]
    wrong = [of for of in results if of["wrong"]]
    whats = sorted({reason["what"] for of in results for reason in of["reasons"]})
    return {
        "runs": len(results),
        "false_alarms": _rate(sound),
        "detected": _rate(wrong),
        "faults": {
            fault: {
                "runs": len(of_fault),
                "wrong": _rate([of for of in of_fault if of["wrong"]]),
                "right": _rate([of for of in of_fault if not of["wrong"]]),
                "delay_s": _median([of["delay_s"] for of in of_fault if of["wrong"] and of["delay_s"] is not None]),
            }
            for fault in ("none", *FAULTS)
            if (of_fault := [of for of in results if of["fault"] == fault])
        },
        "reasons": {what: {"sound": _rate(sound, what), "wrong": _rate(wrong, what)} for what in whats},
    }


def _rate(runs: Sequence[Mapping[str, Any]], what: str | None = None) -> dict[str, Any]:
    """Share of runs with a reason, or with this reason, and the 95 % interval of the share."""
    said = sum(any(what in (None, reason["what"]) for reason in run["reasons"]) for run in runs)
    share = said / len(runs) if runs else None
    return {"of": len(runs), "told": said, "share": share, "interval_95": share_interval(said, len(runs))}


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def trust_tables(summary: Mapping[str, Any]) -> tuple[list[list[str]], ...]:
    """Cells of the tables by rate, by fault and by reason, each with its heading first."""
    rates = [
        ["", "runs", "not trusted", "share", "95 % interval", "wanted"],
        ["without fault and right", *_cells(summary["false_alarms"]), "<= 1 %"],
        [f"off by more than {WRONG:g} m", *_cells(summary["detected"]), ">= 95 %"],
    ]
    faults = [["fault", "runs", "wrong", "of these told", "right", "of these told", "delay, median [s]"]]
    for fault, of in summary["faults"].items():
        delay = "-" if of["delay_s"] is None else f"{of['delay_s']:.2f}"
        counts = [str(of[kind][key]) for kind in ("wrong", "right") for key in ("of", "told")]
        faults.append([fault, str(of["runs"]), *counts, delay])
    reasons = [["reason", "false alarms", "share", "wrong runs told", "share"]]
    for what, of in summary["reasons"].items():
        reasons.append([what, *(cell for kind in ("sound", "wrong") for cell in _cells(of[kind])[1:3])])
    return rates, faults, reasons


def _cells(rate: Mapping[str, Any]) -> list[str]:
    if rate["share"] is None:
        return ["0", "0", "-", "-"]
    low, high = rate["interval_95"]
    return [str(rate["of"]), str(rate["told"]), f"{rate['share']:.1%}", f"{low:.1%} .. {high:.1%}"]
