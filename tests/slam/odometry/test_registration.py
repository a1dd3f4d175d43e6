"""Registration against an independent solver, known motions, changes of frame, and what a corridor does not tell."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from registration_scenes import CORRIDOR, SENSOR, map_of, points_of, seen
from scipy.optimize import least_squares

from features.se2 import compose, inverse, pose, rotation, transform, wrap_angle
from features.sensor import Mounting
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from sim.worlds.world import World
from slam.odometry.line_map import CENTER, LENGTH, NORMAL_X, NORMAL_Y, VAR_ANGLE, VAR_OFFSET, WALL_X, WALL_Y
from slam.odometry.registration import register
from slam.odometry.rules import RegistrationRules

law = settings(derandomize=True, deadline=None, max_examples=40)
RULES = RegistrationRules()
HERE = pose(2.2, 1.7, 0.6)
VAGUE = np.diag([0.3, 0.3, 0.2]) ** 2
ROOM = map_of(room(), [HERE], np.random.default_rng(1))


def information_of_position(information):
    """Of the position alone, the heading unknown, shape (2, 2)."""
    return information[:2, :2] - np.outer(information[:2, 2], information[2, :2]) / information[2, 2]


@law
@given(st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.floats(-0.12, 0.12), st.integers(0, 2**32 - 1))
def test_a_known_motion_is_recovered(x, y, turn, seed):
    """From a prior that is off by decimetres and degrees, to the millimetres that 920 beams of 20 mm allow."""
    truth = compose(HERE, pose(x, y, turn))
    scan = seen(room(), truth, np.random.default_rng(seed))
    fit = register(scan, ROOM, HERE, VAGUE, HERE, RULES)
    error = fit.pose_map_robot - truth
    assert fit.share > 0.8
    assert np.hypot(*error[:2]) < 0.015  # five sigmas of scan and map
    assert abs(wrap_angle(error[2])) < math.radians(0.3)


@law
@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))
def test_a_change_of_the_map_frame_changes_nothing_else(x, y, turn):
    frame = pose(x, y, turn)
    scan = seen(room(), compose(HERE, pose(0.1, -0.05, 0.03)), np.random.default_rng(2))
    walls = ROOM.copy()
    walls[:, [WALL_X, WALL_Y]] = transform(frame, ROOM[:, [WALL_X, WALL_Y]])
    walls[:, [NORMAL_X, NORMAL_Y]] = ROOM[:, [NORMAL_X, NORMAL_Y]] @ rotation(frame[2]).T
    by_frame = np.eye(3)
    by_frame[:2, :2] = rotation(frame[2])
    cov = np.diag([0.1, 0.02, 0.05]) ** 2
    rules = replace(RULES, step=1e-4, max_iterations=50)
    before = register(scan, ROOM, HERE, cov, HERE, rules)
    prior = compose(frame, HERE)
    after = register(scan, walls, prior, by_frame @ cov @ by_frame.T, prior, rules)
    difference = compose(inverse(compose(frame, before.pose_map_robot)), after.pose_map_robot)
    np.testing.assert_allclose(difference, 0.0, atol=2e-5)
    scale = np.sqrt(np.diag(before.information))
    np.testing.assert_allclose(
        (by_frame.T @ after.information @ by_frame) / np.outer(scale, scale),
        before.information / np.outer(scale, scale),
        atol=2e-3,
    )
    assert after.share == pytest.approx(before.share, abs=0.01)


@pytest.mark.parametrize("turns", [-1, 1])
def test_whole_turns_between_prior_and_start_change_nothing(turns):
    scan = seen(room(), compose(HERE, pose(0.1, -0.05, 0.03)), np.random.default_rng(2))
    start = HERE + np.array([0.0, 0.0, turns * 2.0 * math.pi])
    before, after = (register(scan, ROOM, HERE, VAGUE, each, RULES) for each in (HERE, start))
    np.testing.assert_allclose(after.pose_map_robot, before.pose_map_robot, atol=1e-9)
    np.testing.assert_allclose(after.information, before.information, rtol=1e-6)
    np.testing.assert_allclose(after.pull, before.pull, rtol=1e-6)


def one_wall(distance, heading):
    """A wall ahead of the sensor, 4 m long, whose direction and offset are known well."""
    wall = np.zeros(8)
    wall[[WALL_X, WALL_Y]] = distance * math.cos(heading), distance * math.sin(heading)
    wall[[NORMAL_X, NORMAL_Y]] = -math.cos(heading), -math.sin(heading)
    wall[LENGTH], wall[VAR_OFFSET], wall[VAR_ANGLE], wall[CENTER] = 4.0, 2e-3**2, 2e-3**2, 0.3
    return wall


def test_the_result_is_that_of_an_independent_solver():
    """Walls and points alike given to scipy: points by their own variance, each wall's offset and turn as unknowns."""
    walls = np.stack([one_wall(3.0, 0.0), one_wall(2.0, 1.7), one_wall(2.5, -1.9)])
    rng = np.random.default_rng(3)
    truth = pose(0.05, -0.04, 0.02)
    prior, prior_cov = pose(), np.diag([0.05, 0.08, 0.03]) ** 2
    scan = seen_walls(walls, truth, rng)
    # Without robust weights what is left is a Gaussian problem.
    rules = replace(RULES, kernel=1e6, scatter=1e3, crookedness=0.0, roughness=0.0, step=1e-6, max_iterations=50)
    fit = register(scan, walls, prior, prior_cov, prior, rules)
    assert fit.share == 1.0

    # The weights of the points are held at the result, as the last iteration of the registration does.
    normals = walls[scan.lines][:, [NORMAL_X, NORMAL_Y]]
    beams = rotation(fit.pose_map_robot[2]) @ [np.cos(scan.bearings), np.sin(scan.bearings)]
    incidence = (beams.T * normals).sum(axis=1)
    variances = (SENSOR.sigma_range * incidence) ** 2
    variances += (SENSOR.sigma_bearing * scan.ranges) ** 2 * (1.0 - incidence**2)
    wall_sigmas = np.sqrt(walls[:, [VAR_OFFSET, VAR_ANGLE]])

    def residuals(unknown):
        errors = unknown[3:].reshape(-1, 2)
        arms = transform(unknown[:3], scan.points) - walls[scan.lines][:, [WALL_X, WALL_Y]]
        along = arms[:, 0] * normals[:, 1] - arms[:, 1] * normals[:, 0] - walls[scan.lines, CENTER]
        across = (arms * normals).sum(axis=1) - errors[scan.lines, 0] - errors[scan.lines, 1] * along
        whole = [(unknown[:3] - prior) / np.sqrt(np.diag(prior_cov)), across / np.sqrt(variances)]
        return np.concatenate([*whole, (errors / wall_sigmas).ravel()])

    solution = least_squares(residuals, np.zeros(9), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # A thousandth of the standard deviations: Gauss-Newton of ours takes the walls' errors out to first order.
    np.testing.assert_allclose(fit.pose_map_robot, solution.x[:3], atol=2e-6)
    cov = np.linalg.inv(solution.jac.T @ solution.jac)[:3, :3]
    ours = np.linalg.inv(np.linalg.inv(prior_cov) + fit.information)
    scale = np.sqrt(np.diag(cov))
    np.testing.assert_allclose(ours / np.outer(scale, scale), cov / np.outer(scale, scale), atol=0.01)


def seen_walls(walls, truth, rng):
    """A scan that sees each of the walls, each point of it known to belong to its own."""
    normals = walls[:, [NORMAL_X, NORMAL_Y]]
    along = np.column_stack([normals[:, 1], -normals[:, 0]]) * 1.9
    middles = walls[:, [WALL_X, WALL_Y]]
    world = World("walls", np.hstack([middles - along, middles + along]))
    scan = seen(world, truth, rng)
    points = transform(truth, scan.points)
    distances = np.abs(np.einsum("ijk,jk->ij", points[:, None] - middles, normals))
    walls_robot = walls.copy()
    walls_robot[:, [WALL_X, WALL_Y]] = transform(inverse(truth), middles)
    walls_robot[:, [NORMAL_X, NORMAL_Y]] = normals @ rotation(truth[2])
    return replace(scan, lines=distances.argmin(axis=1), walls_robot=walls_robot)


@law
@given(st.floats(-0.2, 0.2), st.floats(-0.05, 0.05), st.integers(0, 2**32 - 1))
def test_along_a_bare_corridor_the_prior_alone_decides(ahead, turn, seed):
    rng = np.random.default_rng(seed)
    walls = map_of(CORRIDOR, [pose(x, 0.0, 0.0) for x in (0.0, 0.4, 0.8)], rng)
    truth = pose(1.0, 0.1, turn)
    scan = seen(CORRIDOR, truth, rng)
    prior = truth + np.array([ahead, 0.05, 0.03])
    fit = register(scan, walls, prior, np.diag([0.1, 0.05, 0.05]) ** 2, prior, RULES)
    assert fit.pose_map_robot[0] == pytest.approx(prior[0], abs=2e-3)  # the little that across and heading imply
    assert abs(fit.pose_map_robot[1] - truth[1]) < 0.015
    assert abs(fit.pose_map_robot[2] - truth[2]) < math.radians(0.3)
    known = np.linalg.eigvalsh(information_of_position(fit.information))
    assert abs(known[0]) < 1e-9 * known[1]


def test_people_in_sight_do_not_move_the_robot():
    """A third of the beams end short of the wall, a few of them near it."""
    rng = np.random.default_rng(5)
    truth = compose(HERE, pose(0.1, 0.05, 0.04))
    scan = seen(room(), truth, rng)
    clean = register(scan, ROOM, HERE, VAGUE, HERE, RULES)
    points = scan.points.copy()
    struck = rng.random(len(scan)) < 0.33
    points[struck] *= rng.uniform(0.3, 0.97, struck.sum())[:, None]
    ranges = np.hypot(*points.T)
    crowded = register(
        replace(scan, points=points, ranges=ranges, lines=np.where(struck, -1, scan.lines)),
        ROOM,
        HERE,
        VAGUE,
        HERE,
        RULES,
    )
    np.testing.assert_allclose(crowded.pose_map_robot, clean.pose_map_robot, atol=0.01)
    assert crowded.share < clean.share - 0.2


def test_a_wall_is_not_seen_from_behind():
    wall = one_wall(3.0, 0.0)[None]
    scan = seen_walls(wall, pose(), np.random.default_rng(6))
    behind = wall.copy()
    behind[:, [NORMAL_X, NORMAL_Y]] *= -1.0
    assert register(scan, wall, pose(), VAGUE, pose(), RULES).share == 1.0
    unseen = register(scan, behind, pose(), VAGUE, pose(), RULES)
    assert unseen.share == 0.0
    np.testing.assert_array_equal(unseen.information, np.zeros((3, 3)))
    np.testing.assert_array_equal(unseen.pose_map_robot, np.zeros(3))


@pytest.mark.parametrize("mounting", [Mounting(0.2, -0.1, 3.0), Mounting(0.1, 0.1, -0.7, upside_down=True)])
def test_the_mounting_does_not_matter_to_the_robot(mounting):
    """A scan of the same room through a sensor that sits elsewhere puts the robot to the same place."""
    rng = np.random.default_rng(7)
    lidar = Lidar.of_preset("rplidar-s1", mounting)
    truth = compose(HERE, pose(0.1, 0.05, 0.04))
    scan = points_of(lidar.scan(room(), truth, 0.0, rng), replace(SENSOR, mounting=mounting))
    assert (np.diff(scan.bearings) >= 0.0).all()
    assert (scan.lines >= 0).mean() > 0.5
    fit = register(scan, ROOM, HERE, VAGUE, HERE, RULES)
    np.testing.assert_allclose(fit.pose_map_robot, truth, atol=0.01)


@pytest.mark.parametrize("inlier", [RULES.inlier, 2.0])
def test_the_share_is_of_the_points_within_three_sigmas_of_a_wall_or_as_many_as_the_rules_say(inlier):
    """Points anywhere within 0.12 m of a wall, and a prior so sure that nothing moves.

    The sigma of each is that of eq. M3 at the wall, with its roughness; those within a thousandth of the gate are left
    out, as rounding could take them over it.
    """
    wall = one_wall(3.0, 0.4)[None]
    scan = seen_walls(wall, pose(), np.random.default_rng(8))
    normal = wall[0, [NORMAL_X, NORMAL_Y]]
    directions = np.stack([np.cos(scan.bearings), np.sin(scan.bearings)], axis=-1)
    incidence = directions @ normal
    distances = wall[0, [WALL_X, WALL_Y]] @ normal / incidence
    offsets = np.linspace(-0.12, 0.12, len(scan))[np.random.default_rng(9).permutation(len(scan))]
    ranges = distances + offsets / incidence
    sigmas = np.sqrt(
        (SENSOR.sigma_range * incidence) ** 2
        + (SENSOR.sigma_bearing * ranges) ** 2 * (1.0 - incidence**2)
        + RULES.roughness**2
    )
    ratios = np.abs(offsets) / sigmas
    kept = np.abs(ratios - inlier) > 3e-3
    assert 0.1 * len(scan) < (ratios[kept] > inlier).sum() < 0.9 * len(scan)
    shown = replace(
        scan,
        points=(ranges[:, None] * directions)[kept],
        ranges=ranges[kept],
        bearings=scan.bearings[kept],
        lines=scan.lines[kept],
        normals=scan.normals[kept],
    )
    rules = replace(RULES, gate=RULES.final_gate, inlier=inlier)
    fit = register(shown, wall, pose(), 1e-18 * np.eye(3), pose(), rules)
    assert fit.share == pytest.approx((ratios[kept] < inlier).mean(), abs=1e-12)


@pytest.mark.parametrize(("kernel", "between"), [(1e3, 0.05), (0.2, 0.0)])
def test_the_scale_of_the_kernel_tells_between_two_walls_that_a_beam_may_meet(kernel, between):
    """The wall as two key frames have it, the second 0.1 m farther: their mean, or the one that the scan is nearer to.

    All points have the same residual, so only the weights of the two walls (eq. M28) move the scan.
    """
    wall = one_wall(3.0, 0.0)
    farther = wall.copy()
    farther[WALL_X] += 0.1
    scan = seen_walls(wall[None], pose(), np.random.default_rng(10))
    rules = replace(RULES, gate=RULES.final_gate, kernel=kernel, step=1e-3, max_iterations=50)
    fit = register(scan, np.stack([wall, farther]), pose(), VAGUE, pose(), rules)
    assert fit.pose_map_robot[0] == pytest.approx(between, abs=0.01)


def pieces_of(scan, count):
    """The same scan with each of its lines cut into so many; with 0, into single points."""
    lines, walls = scan.lines.copy(), []
    for line in range(len(scan.walls_robot) if count else 0):
        parts = np.array_split(np.flatnonzero(scan.lines == line), count)
        for part in parts:
            lines[part] = len(walls)
            walls.append(scan.walls_robot[line])
    if not count:
        lines[:] = -1
    return replace(scan, lines=lines, walls_robot=np.array(walls).reshape(-1, scan.walls_robot.shape[1]))


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_the_pieces_of_a_wall_know_no_more_than_the_wall(count):
    """Two walls along a corridor, seen once: the offset between them is known no better than their own offsets are."""
    rng = np.random.default_rng(3)
    walls = map_of(CORRIDOR, [pose()], rng)
    scan = seen(CORRIDOR, pose(), rng)
    fit = register(pieces_of(scan, count), walls, pose(), VAGUE, pose(), RULES)
    assert len(walls) == 2
    known = (1.0 / walls[:, VAR_OFFSET]).sum()
    across = fit.information[1, 1]
    # A scan as sure as the walls leaves half of what these know; it is rougher than they are.
    assert 0.2 * known < across < 0.55 * known
