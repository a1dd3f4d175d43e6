"""Each kind of reason is raised exactly when it should be, once and at its first time; a clean run raises none."""

import logging
import math

import numpy as np
import pytest

from features.se2 import compose, inverse, pose, rotation, transform
from slam.filter.association import Association
from slam.trust.monitor import TrustMonitor
from slam.trust.rules import TrustRules

RULES = TrustRules()
PROBABILITY = 0.99
PAIRS = 8
SURE, NOWHERE = 0.9, None
"""Share of a scan that fits known walls, and that of one that fits nowhere."""

PILLARS = np.array([[2.0 * i, 2.0 * j] for i in range(-4, 5) for j in range(-4, 5) if (i, j) != (0, 0)])
"""Points about the robot, so far from each other that each shows itself only."""


def watching(*, wheels=True):
    return TrustMonitor(PROBABILITY, 0.45, wheels=wheels)


def raised(monitor):
    trust = monitor.trust
    assert trust.ok == (not trust.reasons)
    return [(reason.what, reason.stamp) for reason in trust.reasons]


def matched(nis, pairs=PAIRS):
    return Association(np.arange(pairs), np.arange(pairs), np.empty(0, np.int64), nis)


def test_a_clean_run_raises_no_add_reason(caplog):
    """Innovations as large as promised, walls in every scan, wheels that agree, and some scans that fit badly."""
    rng = np.random.default_rng(0)
    monitor, here = watching(), pose()
    for k in range(4 * RULES.window):
        motion = pose(0.2, 0.0, 0.1)
        here = compose(here, motion)
        monitor.updated(float(k), matched(float(rng.chisquare(2 * PAIRS))))
        monitor.drove(float(k), motion, seen=k % 10 != 0)
        points = transform(inverse(here), PILLARS)
        monitor.registered(float(k), points, here, here, SURE if k % 5 else NOWHERE, rejected=k % 10 == 0)
    assert raised(monitor) == []
    assert monitor.nis is not None
    assert not caplog.records


def test_innovations_are_doubted_where_they_stay_above_what_the_filter_promises():
    """All windows of one length are above: the first and the last share no update. From then on it is told once."""
    monitor = watching()
    for k in range(2 * RULES.window - 1):
        monitor.updated(float(k), matched(10.0 * 2 * PAIRS))
        monitor.updated(float(k), matched(0.0, 0))
    assert raised(monitor) == []
    for k in range(2 * RULES.window - 1, 3 * RULES.window):
        monitor.updated(float(k), matched(10.0 * 2 * PAIRS))
    assert raised(monitor) == [("innovations", 2.0 * RULES.window - 1.0)]


def test_innovations_smaller_than_promised_are_not_doubted():
    monitor = watching()
    for k in range(4 * RULES.window):
        monitor.updated(float(k), matched(0.1 * PAIRS))
    assert raised(monitor) == []


@pytest.mark.parametrize(
    ("motion", "allowed"),
    [(pose(-0.6, 0.8), RULES.blind_travel), (pose(0.0, 0.0, 0.5), math.pi), (pose(0.0, 0.0, -0.5), math.pi)],
    ids=["travel", "left", "right"],
)
def test_motion_on_odometry_alone_is_doubted_beyond_its_limit(motion, allowed):
    """Metres and angles add up however the robot goes; what is seen on the way ends the count."""
    step = float(np.hypot(*motion[:2]) + abs(motion[2]))
    within = math.floor(allowed / step)
    monitor = watching()
    for k in range(3 * within):
        monitor.drove(float(k), motion, seen=k % within == within - 1)
    assert raised(monitor) == []
    for k in range(100, 100 + 2 * within):
        monitor.drove(float(k), motion, seen=False)
    assert raised(monitor) == [("blind", 100.0 + within)]


def test_a_scan_that_shows_nothing_of_the_one_before_is_doubted_at_once():
    monitor = watching()
    monitor.registered(1.0, PILLARS, pose(), pose(), SURE, rejected=False)
    monitor.registered(2.0, PILLARS + 0.9, pose(0.1), pose(0.1), NOWHERE, rejected=False)
    monitor.registered(3.0, PILLARS, pose(0.2), pose(0.2), NOWHERE, rejected=False)
    assert raised(monitor) == [("carried away", 2.0)]
    (reason,) = monitor.trust.reasons
    assert "carried away" in reason.sentence


@pytest.mark.parametrize(
    ("points", "motion", "share"),
    [
        (PILLARS + 0.9, pose(0.1), SURE),
        (PILLARS + 0.9, pose(1.01 * RULES.small_motion), NOWHERE),
        (PILLARS + 0.9, pose(0.0, 0.0, -1.01 * RULES.small_turn), NOWHERE),
        (PILLARS[:29] + 0.9, pose(0.1), NOWHERE),
    ],
    ids=["it fits known walls", "moved far", "turned far", "few points"],
)
def test_a_scan_that_tells_no_more_than_that_is_not_doubted(points, motion, share):
    monitor = watching()
    monitor.registered(1.0, PILLARS, pose(), pose(), SURE, rejected=False)
    monitor.registered(2.0, points, motion, motion, share, rejected=False)
    assert raised(monitor) == []


@pytest.mark.parametrize(("new", "doubted"), [(0.4, False), (0.6, True)])
def test_a_scan_of_which_more_than_half_is_new_is_doubted(new, doubted):
    """People may hide a part of what was seen before, not most of it."""
    count = round(new * len(PILLARS))
    points = np.concatenate([PILLARS[:count] + 0.9, PILLARS[count:]])
    monitor = watching()
    monitor.registered(1.0, PILLARS, pose(), pose(), SURE, rejected=False)
    monitor.registered(2.0, points, pose(), pose(), NOWHERE, rejected=False)
    assert [what for what, _ in raised(monitor)] == ["carried away"] * doubted


@pytest.mark.parametrize("opens", [True, False])
def test_a_scan_that_shows_much_more_or_much_less_of_the_same_is_not_doubted(opens):
    """A door opens or closes, and the robot is where it was."""
    few, many = PILLARS[: RULES.fewest_points], np.concatenate([PILLARS[: RULES.fewest_points], PILLARS + 0.9])
    monitor = watching()
    monitor.registered(1.0, few if opens else many, pose(), pose(), SURE, rejected=False)
    monitor.registered(2.0, many if opens else few, pose(), pose(), NOWHERE, rejected=False)
    assert raised(monitor) == []


@pytest.mark.parametrize("share", [NOWHERE, 0.1])
def test_a_scan_is_laid_on_the_one_before_by_the_motion_between_them(share):
    """From 0.45 m further on and 18 deg turned, each way: all else would put these points beside those of before."""
    for motion in (pose(0.45, 0.0, math.radians(18.0)), pose(-0.3, 0.3, math.radians(-18.0))):
        monitor, home = watching(), pose(3.0, -2.0, 2.5)
        monitor.registered(1.0, transform(inverse(home), PILLARS), home, home, SURE, rejected=False)
        here = compose(home, motion)
        monitor.registered(2.0, transform(inverse(here), PILLARS), here, home, share, rejected=False)
        assert raised(monitor) == []
        # The same points without the motion are those of somewhere else.
        monitor.registered(3.0, transform(inverse(home), PILLARS), here, home, share, rejected=False)
        assert raised(monitor) == [("carried away", 3.0)]


def driven(monitor, rejected, motion=pose(0.1), by_wheels=pose(0.1)):  # noqa: B008, not written to
    """Register scans, each after a motion; stamps are their numbers, that of the first, which ends none, is -1."""
    here, odom = pose(), pose()
    monitor.registered(-1.0, PILLARS, here, odom, SURE, rejected=False)
    for k, each in enumerate(rejected):
        here, odom = compose(here, motion), compose(odom, by_wheels)
        monitor.registered(float(k), PILLARS, here, odom, SURE, rejected=bool(each))


MANY = math.floor(RULES.most_rejected * RULES.judged) + 1
"""The fewest rejections of RULES.judged that are too many."""


def test_wheels_are_doubted_where_too_many_of_the_latest_scans_contradict_them():
    monitor = watching()
    driven(monitor, [True] * (MANY - 1) + [False] * RULES.judged + [True] * (MANY - 1) + [False] * RULES.judged)
    assert raised(monitor) == []
    monitor = watching()
    driven(monitor, [True] * MANY + [False] * RULES.judged)
    assert raised(monitor) == [("odometry", RULES.judged - 1.0)]
    (reason,) = monitor.trust.reasons
    assert "beside its heading" not in reason.sentence


def test_wheels_are_judged_in_motion_only():
    standing = watching()
    driven(standing, [True] * 3 * RULES.judged, pose(0.01), pose(0.01))
    assert raised(standing) == []
    for motion, by_wheels in [(pose(0.1), pose()), (pose(), pose(0.0, 0.1)), (pose(0.0, 0.0, -0.1), pose())]:
        monitor = watching()
        driven(monitor, [True] * RULES.judged, motion, by_wheels)
        assert [what for what, _ in raised(monitor)] == ["odometry"]


def test_without_wheels_too_many_rejected_predictions_speak_against_the_motion_itself():
    """The poses by wheels that are not there do not move."""
    monitor = watching(wheels=False)
    driven(monitor, [True] * (MANY - 1) + [False] * RULES.judged, by_wheels=pose())
    assert raised(monitor) == []
    driven(monitor, [True] * MANY + [False] * RULES.judged, by_wheels=pose())
    (reason,) = monitor.trust.reasons
    assert reason.what == "motion"
    assert "odometry is contradicted" not in reason.sentence


@pytest.mark.parametrize("reported", [0.0, 90.0, -160.0])
@pytest.mark.parametrize("angle", [90.0, -60.0])
def test_the_doubt_of_the_wheels_names_the_angle_by_which_they_are_turned(angle, reported):
    """Whatever direction the wheels report, the robot moves to the left of it by the angle."""
    monitor, ahead = watching(), np.array([0.1, 0.0])
    motion, by_wheels = (pose(*(rotation(math.radians(each)) @ ahead)) for each in (reported + angle, reported))
    driven(monitor, [True] * RULES.judged, motion, by_wheels)
    (reason,) = monitor.trust.reasons
    assert f"moves {angle:.0f} deg beside its heading" in reason.sentence


def test_doubts_are_kept_in_the_order_in_which_they_came_and_each_is_logged_once(caplog):
    monitor = watching()
    with caplog.at_level(logging.WARNING):
        for k in range(10):
            monitor.drove(float(k), pose(RULES.blind_travel - 0.5), seen=False)
        driven(monitor, [True] * 2 * RULES.judged)
    assert [what for what, _ in raised(monitor)] == ["blind", "odometry"]
    assert [record.levelno for record in caplog.records] == [logging.WARNING] * 2
    assert all(
        reason.sentence in record.getMessage()
        for reason, record in zip(monitor.trust.reasons, caplog.records, strict=True)
    )


@pytest.mark.parametrize(("share", "told"), [(NOWHERE, True), (0.4, True), (SURE, False)])
def test_a_jump_is_a_reason_unless_the_scan_behind_it_is_sure_to_fit(share, told):
    monitor = watching()
    monitor.jumped(3.0, share)
    assert raised(monitor) == ([("jump", 3.0)] if told else [])


def test_a_reason_lasts_until_it_was_noticed_last():
    monitor = watching()
    driven(monitor, [True] * (RULES.judged + 5) + [False] * 3 * RULES.judged)
    (reason,) = monitor.trust.reasons
    # The share falls below its limit once so many of the rejections have left the window.
    assert (reason.stamp, reason.until) == (RULES.judged - 1.0, 2.0 * RULES.judged + 4.0 - MANY)
