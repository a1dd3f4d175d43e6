"""Dead reckoning between any two key frames: its covariance is that of motions drawn at random."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from features.se2 import between, compose, pose
from slam.loop.dead_reckoning import DeadReckoning

MOTIONS = [pose(0.5, 0.02, turn) for turn in np.radians([3.0] * 20 + [-9.0] * 20 + [0.0] * 20)]
COV = np.diag([0.02, 0.01, math.radians(0.3)]) ** 2
NOTHING = np.zeros((3, 3))


def reckoned(motions, cov=COV):
    reckoning = DeadReckoning()
    for motion in [pose(), *motions]:
        reckoning.add(motion, cov)
    return reckoning


def chain(motions):
    here = pose()
    for motion in motions:
        here = compose(here, motion)
    return here


@pytest.mark.slow
@pytest.mark.parametrize("older", [0, 15, 50])
def test_distances_of_what_may_have_happened_are_chi_square(older):
    """Of 400 draws; six sigmas of the mean of so many are the tolerance, as errors are small and so all but linear."""
    rng = np.random.default_rng(0)
    reckoning = reckoned(MOTIONS)
    true = np.array(
        [chain([motion + rng.multivariate_normal(np.zeros(3), COV) for motion in MOTIONS[older:]]) for _ in range(400)]
    )
    distances2 = reckoning.distances2(np.full(400, older), true, NOTHING)
    assert abs(distances2.mean() - 3.0) < 6.0 * math.sqrt(6.0 / 400)
    assert (distances2 > chi2.ppf(0.99, 3)).mean() < 0.03


def test_what_odometry_says_is_no_distance_away():
    reckoning = reckoned(MOTIONS)
    older = np.array([0, 7, 42, 59])
    motions = np.array([chain(MOTIONS[key:]) for key in older])
    np.testing.assert_allclose(reckoning.distances2(older, motions, NOTHING), 0.0, atol=1e-12)


def test_blur_is_told_in_the_axes_of_the_robot():
    """Where odometry has no error, a motion a metre ahead of it is a metre off against the blur ahead."""
    reckoning = reckoned(MOTIONS, NOTHING)
    blur = np.diag([4.0, 1.0, 0.01])
    ahead, aside = compose(chain(MOTIONS), pose(1.0)), compose(chain(MOTIONS), pose(0.0, 1.0))
    found = reckoning.distances2(np.array([0, 0]), np.array([ahead, aside]), blur)
    np.testing.assert_allclose(found, [0.25, 1.0], rtol=1e-9)


def test_a_turn_is_told_across_the_cut_of_angles():
    motions = [pose(0.0, 0.0, math.radians(170.0)), pose(0.0, 0.0, math.radians(30.0))]
    slipped = pose(0.0, 0.0, math.radians(160.0 + 2.0) - 2.0 * math.pi + math.radians(38.0))
    distance2 = reckoned(motions).distances2(np.array([0]), slipped[None], NOTHING)
    assert distance2[0] == pytest.approx(0.0, abs=1e-9)
    assert between(chain(motions), slipped) == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_slip_over_the_cut_of_angles_is_as_small_as_one_away_from_it():
    slips = [pose(0.0, 0.0, math.radians(degrees)) for degrees in (-1.0, 1.0)]
    motions = [pose(1.0, 0.0, math.radians(100.0)), pose(1.0, 0.0, math.radians(79.5))]
    slipped = np.array([compose(chain(motions), slip) for slip in slips])
    away, over = reckoned(motions).distances2(np.zeros(2, np.int64), slipped, NOTHING)
    assert over == pytest.approx(away, rel=1e-9)


def test_what_odometry_says_is_no_distance_away_wherever_on_a_circle_the_motion_begins():
    """Headings add up over the cut of angles, from some key frames once and from others twice."""
    motions = [pose(0.5, 0.0, math.radians(40.0))] * 14
    reckoning = reckoned(motions)
    older = np.arange(14)
    said = np.array([chain(motions[key:]) for key in older])
    np.testing.assert_allclose(reckoning.distances2(older, said, NOTHING), 0.0, atol=1e-9)
