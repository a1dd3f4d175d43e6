"""The study of trust: faults do what they say, and the rates count the runs that they should."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom

from features.se2 import between
from slam.study.trust.faults import FAULTS, Scene, drawn_scene
from slam.study.trust.runs import TrustSettings, run_rows, run_task, share_interval, trust_summary, trust_tables

SEED, SCANS = 7, 40


def scene(fault: str | None) -> Scene:
    return drawn_scene(1, fault, SCANS, SEED)


def ran(fault: str, worst: float, *reasons: str) -> dict[str, Any]:
    told = [{"what": what, "stamp": 3.0, "until": 4.0} for what in reasons]
    return {
        "fault": fault,
        "wrong": worst > 0.5,
        "reasons": told,
        "delay_s": 1.0 if told and fault != "none" else None,
    }


@pytest.mark.parametrize(("count", "of"), [(0, 30), (3, 30), (30, 30)])
def test_an_interval_ends_where_what_was_seen_has_the_probability_of_a_tail(count: int, of: int) -> None:
    low, high = share_interval(count, of)
    assert low <= count / of <= high
    if count:
        assert binom.sf(count - 1, of, low) == pytest.approx(0.025)
    if count < of:
        assert binom.cdf(count, of, high) == pytest.approx(0.025)


def test_rates_are_of_right_runs_without_fault_and_of_all_wrong_runs() -> None:
    summary = trust_summary(
        [
            ran("none", 0.1),
            ran("none", 0.1, "odometry"),
            ran("none", 2.0),
            ran("slip", 0.1, "odometry"),
            ran("kidnap", 2.0, "carried away", "odometry"),
        ]
    )
    assert [summary["false_alarms"][key] for key in ("of", "told")] == [2, 1]
    assert [summary["detected"][key] for key in ("of", "told")] == [2, 1]
    assert summary["reasons"]["carried away"]["sound"]["told"] == 0
    assert summary["reasons"]["carried away"]["wrong"]["told"] == 1
    assert summary["faults"]["slip"]["right"]["told"] == 1
    assert summary["faults"]["kidnap"]["delay_s"] == 1.0


def test_a_study_of_wrong_runs_only_has_no_rate_of_false_alarms() -> None:
    summary = trust_summary([ran("kidnap", 2.0)])
    rates, _, _ = trust_tables(summary)
    assert rates[1][1:] == ["0", "0", "-", "-", "<= 1 %"]
    assert rates[2][1:4] == ["1", "0", "0.0%"]


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_scene_has_as_many_scans_as_asked_with_and_without_fault(fault: str) -> None:
    drawn = scene(fault)
    assert sum(frame.scan is not None for frame in drawn.frames) == SCANS
    assert len(drawn.truth) == len(drawn.frames)
    assert drawn.frames[0].stamp <= drawn.begun < drawn.frames[-1].stamp
    assert all(frame.scan is None or frame.scan.stamp == pytest.approx(frame.stamp) for frame in drawn.frames)


@pytest.mark.slow
def test_a_jump_is_in_the_odometry_of_one_record_alone() -> None:
    drawn = scene("jump")
    odometry = np.array([frame.pose_odom_robot for frame in drawn.frames])
    steps = np.array([np.hypot(*between(a, b)[:2]) for a, b in pairwise(odometry)])
    assert drawn.frames[int(steps.argmax()) + 1].stamp == pytest.approx(drawn.begun)
    assert steps.max() == pytest.approx(drawn.size, abs=0.05)
    assert np.sort(steps)[-2] < 0.1


@pytest.mark.slow
def test_a_kidnapped_robot_is_elsewhere_at_once_and_its_odometry_does_not_tell() -> None:
    drawn = scene("kidnap")
    way = np.hypot(*np.diff(drawn.truth.poses[:, :2], axis=0).T)
    assert drawn.frames[int(way.argmax()) + 1].stamp == pytest.approx(drawn.begun)
    assert way.max() == pytest.approx(drawn.size, abs=0.05)
    odometry = np.array([frame.pose_odom_robot for frame in drawn.frames])
    assert np.hypot(*np.diff(odometry[:, :2], axis=0).T).max() < 0.1


@pytest.mark.slow
def test_blocked_beams_are_those_of_one_sector_from_the_moment_on() -> None:
    drawn, free = scene("blocked"), scene(None)
    assert math.isnan(free.begun)
    for frame in drawn.frames:
        if frame.scan is None:
            continue
        blocked = (frame.scan.ranges == 0.3) | np.isinf(frame.scan.ranges)
        if frame.stamp >= drawn.begun:
            assert blocked.mean() > 0.1


@pytest.mark.slow
def test_a_run_tells_how_wrong_it_was_and_is_the_same_again() -> None:
    settings = TrustSettings(runs=1, faulty=1, scans=SCANS)
    result = run_task(settings, 0, SEED)
    assert result == run_task(settings, 0, SEED)
    assert result["worst_m"] >= result["final_m"] > 0.0
    assert run_rows([result])[0]["reasons"] == ""
