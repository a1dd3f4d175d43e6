"""Faults of robot, odometry, sensor and configuration: the result is right, or the run says that it is not."""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from drivers import Frame
from features import LaserScan
from features.se2 import Array, between, compose
from features.sensor import Mounting
from sim import room_run
from slam.config_file import load_config
from slam.evaluation.metrics import ate
from slam.pipeline import Slam
from slam.result.result import SlamResult
from slam.result.trajectory import Trajectory

BEGIN, END = 1000, 1500
"""Records between which it happens: ten seconds."""

RECORDS = 2000

Scene = tuple[list[Frame], Array]


@cache
def drive() -> Scene:
    source = room_run(1)
    return list(source)[:3500], source.poses_world_robot[:3500]


def unharmed() -> Scene:
    frames, poses = drive()
    return frames[:RECORDS], poses[:RECORDS]


def kidnapped() -> Scene:
    """The robot is taken to where it would have been 14 s later; wheels and clock do not notice."""
    frames, poses = drive()
    jump = 700
    before, after = frames[:BEGIN], frames[BEGIN + jump : RECORDS + jump]
    waited = after[0].stamp - frames[BEGIN].stamp
    last, first = before[-1].pose_odom_robot, frames[BEGIN + jump - 1].pose_odom_robot
    moved = [
        Frame(frame.stamp - waited, compose(last, between(first, frame.pose_odom_robot)), frame.scan) for frame in after
    ]
    return before + moved, np.concatenate([poses[:BEGIN], poses[BEGIN + jump : RECORDS + jump]])


def wheels_stuck() -> Scene:
    frames, poses = unharmed()
    stuck = [
        replace(frame, pose_odom_robot=frames[BEGIN].pose_odom_robot) if BEGIN <= record < END else frame
        for record, frame in enumerate(frames)
    ]
    return stuck, poses


def wheels_lost() -> Scene:
    """The same, and what was driven in the meantime is not told afterwards either."""
    frames, poses = wheels_stuck()
    held, resumed = frames[END - 1].pose_odom_robot, drive()[0][END - 1].pose_odom_robot
    return frames[:END] + [
        replace(frame, pose_odom_robot=compose(held, between(resumed, frame.pose_odom_robot))) for frame in frames[END:]
    ], poses


def wheels_restarted() -> Scene:
    frames, poses = unharmed()
    zero = frames[BEGIN].pose_odom_robot
    anew = [replace(frame, pose_odom_robot=between(zero, frame.pose_odom_robot)) for frame in frames[BEGIN:]]
    return frames[:BEGIN] + anew, poses


def wheels_restarted_unseen() -> Scene:
    """The same, and for ten seconds the scans show nothing."""
    frames, poses = wheels_restarted()
    blind = [
        replace(frame, scan=without_returns(frame.scan)) if frame.scan is not None and BEGIN <= record < END else frame
        for record, frame in enumerate(frames)
    ]
    return blind, poses


def records_missing() -> Scene:
    frames, poses = unharmed()
    return frames[:BEGIN] + frames[END:], np.concatenate([poses[:BEGIN], poses[END:]])


def changed(change: Callable[[LaserScan], LaserScan], begin: int = 0, end: int = RECORDS) -> Scene:
    frames, poses = unharmed()
    return [
        replace(frame, scan=change(frame.scan)) if frame.scan is not None and begin <= record < end else frame
        for record, frame in enumerate(frames)
    ], poses


def without_returns(scan: LaserScan) -> LaserScan:
    return replace(scan, ranges=np.full(len(scan), math.inf))


def without_beams(scan: LaserScan) -> LaserScan:
    return LaserScan(np.empty(0), np.empty(0), scan.stamp)


def false_beams() -> Callable[[LaserScan], LaserScan]:
    rng = np.random.default_rng(5)

    def change(scan: LaserScan) -> LaserScan:
        return replace(
            scan, ranges=np.where(rng.random(len(scan)) < 0.3, rng.uniform(0.2, 12.0, len(scan)), scan.ranges)
        )

    return change


def false_walls() -> Callable[[LaserScan], LaserScan]:
    """Eleven of 36 sectors, others in each scan, end at an arc in front of the walls."""
    rng = np.random.default_rng(5)

    def change(scan: LaserScan) -> LaserScan:
        ranges, width = scan.ranges.copy(), len(scan) // 36
        for sector in rng.choice(36, 11, replace=False):
            beams = slice(sector * width, (sector + 1) * width)
            ranges[beams] = np.minimum(ranges[beams], rng.uniform(0.3, 4.0))
        return replace(scan, ranges=ranges)

    return change


def run(scene: Scene, yaw: float = 0.0) -> tuple[SlamResult, float]:
    """Result and its error in the frame of the first pose [m]."""
    source = room_run(1)
    mounting = Mounting(source.mounting.x, source.mounting.y, source.mounting.theta + yaw)
    slam = Slam(load_config(None, source=replace(source.info, mounting=mounting)))
    frames, poses = scene
    for frame in frames:
        slam.process(frame)
    result = slam.finish()
    stamps = np.array([frame.stamp for frame in frames])
    return result, ate(Trajectory(stamps, poses), result.trajectory).rmse_m


def said(result: SlamResult) -> Sequence[str]:
    return [doubt.what for doubt in result.metrics.trust.reasons]


@pytest.mark.slow
def test_a_run_without_fault_is_trusted(caplog: pytest.LogCaptureFixture) -> None:
    result, error = run(unharmed())
    assert error < 0.02
    assert result.metrics.trust.ok
    assert said(result) == []
    assert not caplog.records


@pytest.mark.slow
def test_a_robot_that_was_carried_away_is_noticed_at_once(caplog: pytest.LogCaptureFixture) -> None:
    scene = kidnapped()
    result, error = run(scene)
    assert error > 0.5
    assert not result.metrics.trust.ok
    assert said(result)[0] == "carried away"
    # By the first scan after it, at most five records later.
    happened = scene[0][BEGIN].stamp
    assert happened <= result.metrics.trust.reasons[0].stamp <= happened + 0.1 + 1e-6
    assert [record.levelno for record in caplog.records if "carried away" in record.message] == [logging.WARNING]


@pytest.mark.slow
@pytest.mark.parametrize("scene", [wheels_stuck, wheels_lost])
def test_wheels_that_stand_still_for_ten_seconds_do_no_harm_and_are_told(scene: Callable[[], Scene]) -> None:
    result, error = run(scene())
    assert error < 0.05
    assert "odometry" in said(result)


@pytest.mark.slow
def test_odometry_that_starts_anew_does_no_harm_and_is_told_in_one_line(caplog: pytest.LogCaptureFixture) -> None:
    result, error = run(wheels_restarted())
    assert error < 0.02
    assert result.metrics.trust.ok
    assert result.metrics.registrations.odometry_jumps == 1
    assert [record.levelno for record in caplog.records if "jumped" in record.message] == [logging.WARNING]


@pytest.mark.slow
def test_odometry_that_starts_anew_while_no_scan_shows_anything_is_a_reason_at_once() -> None:
    scene = wheels_restarted_unseen()
    result, _ = run(scene)
    assert said(result)[0] == "jump"
    assert scene[0][BEGIN].stamp <= result.metrics.trust.reasons[0].stamp <= scene[0][BEGIN].stamp + 0.1 + 1e-6


@pytest.mark.slow
def test_ten_seconds_without_any_record_do_no_harm() -> None:
    result, error = run(records_missing())
    assert error < 0.05
    assert result.metrics.trust.ok


@pytest.mark.slow
@pytest.mark.parametrize("change", [without_returns, without_beams])
def test_scans_of_nothing_for_ten_seconds_do_no_harm(change: Callable[[LaserScan], LaserScan]) -> None:
    """The wheels, of 5 % of a metre and 3 deg, carry over four metres; what is seen after puts it right."""
    result, error = run(changed(change, BEGIN, END))
    assert error < 0.05
    assert "carried away" not in said(result)


def test_scans_of_nothing_for_good_are_told() -> None:
    result, _ = run(changed(without_returns))
    assert said(result) == ["blind"]


@pytest.mark.slow
@pytest.mark.parametrize("make", [false_beams, false_walls])
def test_a_third_of_false_returns_does_no_harm(make: Callable[[], Callable[[LaserScan], LaserScan]]) -> None:
    result, error = run(changed(make()))
    assert error < 0.05
    assert "carried away" not in said(result)


@pytest.mark.slow
def test_a_sensor_configured_the_wrong_way_round_is_told_with_its_angle() -> None:
    result, _ = run(unharmed(), yaw=math.pi)
    (doubt,) = result.metrics.trust.reasons
    assert doubt.what == "odometry"
    assert "moves 180 deg beside its heading" in doubt.sentence or "moves -180 deg beside" in doubt.sentence
    assert "mounting" in doubt.sentence
