"""Line-aided odometry of simulated robots: consistent increments, with and without wheels, and what is not believed."""

import copy
import dataclasses
import math
from dataclasses import astuple
from functools import cache

import numpy as np
import pytest
from places import DATA
from registration_scenes import CONFIG, CORRIDOR, LIDAR, LINE_DISTANCE, SENSOR, WHEELS, corridor_run
from scipy.stats import chi2

from drivers.carmen.log import CarmenLog
from drivers.frame import Frame
from features.extraction import extract
from features.scan import LaserScan
from features.se2 import between, compose, pose, wrap_angle
from sim import SimulatedRun, World, room_run
from sim.motion.jumping_odometry import JumpingOdometry
from sim.motion.robot import Robot
from sim.worlds.built_in.demo_room import room
from slam.config import SlamConfig
from slam.errors import DivergedError
from slam.evaluation.relations import Relations, read_relations, relations
from slam.odometry.beams import BEFORE, ON, THROUGH, UNKNOWN
from slam.odometry.line_odometry import LineOdometry
from slam.odometry.registration import Registration, register
from slam.parts import line_odometry
from slam.result.trajectory import Trajectory


def config_of(run, **odometry):
    config = SlamConfig.of_preset(run.sensor)
    return config.model_copy(update={"odometry": config.odometry.model_copy(update=odometry)})


def follow(frames, truths, config, step=0.3):
    """Errors and covariances of the increments between key frames, and the odometry at the end."""
    sensor = config.sensor.model()
    odometry: LineOdometry | None = None
    errors, covs = [], []
    for frame, truth in zip(frames, truths, strict=True):
        if odometry is None:
            odometry = line_odometry(config, frame.pose_odom_robot)
            anchor, truth_then = odometry.clone(), None
        odometry.predict(frame.stamp, frame.pose_odom_robot)
        if frame.scan is None:
            continue
        odometry.register(frame.stamp, frame.scan, extract(frame.scan, sensor, config.extraction).lines)
        if truth_then is None or anchor.travel >= step or anchor.turn >= math.radians(15.0):
            if truth_then is not None:
                error = anchor.motion - between(truth_then, truth)
                error[2] = wrap_angle(error[2])
                errors.append(error)
                covs.append(anchor.motion_cov)
            odometry.add_key_frame()
            anchor.reset()
            truth_then = truth
    assert odometry is not None
    return np.array(errors), np.array(covs), odometry


def followed(run, **odometry):
    return follow(run, run.poses_world_robot, config_of(run, **odometry))


def mean_nees(errors, covs):
    return float(np.mean([e @ np.linalg.solve(c, e) for e, c in zip(errors, covs, strict=True)]))


@pytest.mark.slow
@pytest.mark.parametrize("source", ["line-aided", "lines"])
def test_increments_in_a_room_are_consistent(source):
    """NEES of all increments below the upper 99.9 % bound, and above half of 3: neither bold nor absurdly wide."""
    errors, covs, odometry = followed(room_run(11), source=source)
    count = len(errors)
    assert count > 100
    assert 1.5 < mean_nees(errors, covs) < chi2.ppf(0.999, 3 * count) / count
    # Each coordinate for itself, too: 2 is what a claim of 0.7 of the true error would come to.
    squares = np.mean(errors**2 / np.array([np.diag(c) for c in covs]), axis=0)
    assert (squares < chi2.ppf(0.9999, count) / count).all()
    assert (squares > 0.4).all()
    assert odometry.counts.failed == 0
    # Two rounds, 40 m: the drift is that of the walls, not that of the wheels.
    assert np.hypot(*(odometry.pose - room_run(11).poses_world_robot[-1])[:2]) < 0.05


@pytest.mark.slow
def test_increments_along_a_bare_corridor_are_consistent_and_the_prior_s():
    errors, covs, ways = [], [], []
    for seed in range(3):
        run = corridor_run(seed)
        some_errors, some_covs, odometry = followed(run)
        errors += list(some_errors)
        covs += list(some_covs)
        ways.append((odometry.pose - run.poses_world_robot[-1])[0])
        # Across and in heading the walls hold it.
        assert abs(odometry.pose[1] - run.poses_world_robot[-1, 1]) < 0.02
        assert abs(wrap_angle(odometry.pose[2] - run.poses_world_robot[-1, 2])) < math.radians(0.3)
    count = len(errors)
    assert 1.5 < mean_nees(errors, covs) < chi2.ppf(0.999, 3 * count) / count
    # Along it the wheels drift 0.05 m per root of a metre, over 16 m.
    assert 0.02 < np.sqrt(np.mean(np.square(ways))) < 0.6
    largest = np.sqrt([np.linalg.eigvalsh(c[:2, :2])[-1] for c in covs])
    # An increment of 0.3 m along the corridor has the sigma of the wheels.
    assert np.median(largest) == pytest.approx(0.05 * math.sqrt(0.3), rel=0.25)


def box_run(jump, every, lidar=LIDAR):
    """There and back in a box of 6 m by 4 m, of every n-th record of 50 a second; the wheels jump on the way."""
    box = World.from_polygons("box", [[(0, 0), (6, 0), (6, 4), (0, 4)]])
    drive = Robot().drive([(1.2, 1.2), (4.6, 1.6), (4.6, 2.9)], 50.0 / every)
    odometry = JumpingOdometry(WHEELS, len(drive.stamps) // 2, jump)
    return SimulatedRun("box", box, lidar, "rplidar-s1", drive, odometry, 4)


HALF_SEEN = dataclasses.replace(LIDAR, angles=np.radians(np.arange(-90.0, 90.0, 0.5)))

QUARTER = math.pi / 2
JUMPS = [pose(0.7), pose(-0.7), pose(0.0, 0.7), pose(0.0, -0.7), pose(0.0, 0.0, QUARTER), pose(5.0, 0.0, -1.0), None]


@pytest.mark.parametrize("jump", JUMPS)
@pytest.mark.parametrize("every", [1, 5])
def test_a_step_that_no_robot_makes_is_left_out(jump, every):
    run = box_run(jump, every)
    _, _, odometry = followed(run)
    error = odometry.pose - run.poses_world_robot[-1]
    assert np.hypot(*error[:2]) < 0.02
    assert abs(wrap_angle(error[2])) < math.radians(0.3)
    assert odometry.counts.odometry_jumps == 1


@pytest.mark.parametrize("jump", JUMPS[:5])
@pytest.mark.parametrize("lidar", [LIDAR, HALF_SEEN], ids=["all round", "ahead"])
def test_a_step_that_a_fast_robot_could_make_is_denied_by_the_beams(jump, lidar):
    """The walls along the step fit wherever it leads: all that is seen of the others tells."""
    run = box_run(jump, 5, lidar)
    _, _, odometry = followed(run, speed_m_s=100.0, turn_rate_deg_s=1e4)
    assert np.hypot(*(odometry.pose - run.poses_world_robot[-1])[:2]) < 0.02
    assert odometry.counts.odometry_jumps == 0
    assert odometry.counts.predictions_rejected >= 1


def test_a_step_that_was_driven_is_found_again_where_it_was_taken_for_a_jump():
    """The records stop for a while, and so does their clock: the stamps tell of no time in which to drive that far."""
    run = box_run(pose(), 5)
    frames, truths = list(run), list(run.poses_world_robot)
    begin, end = 20, 35
    waited = frames[end].stamp - frames[begin].stamp
    late = [dataclasses.replace(frame, stamp=frame.stamp - waited) for frame in frames[end + 1 :]]
    _, _, odometry = follow(frames[: begin + 1] + late, truths[: begin + 1] + truths[end + 1 :], config_of(run))
    assert odometry.counts.odometry_jumps == 1
    assert odometry.counts.predictions_rejected >= 1
    assert np.hypot(*(odometry.pose - truths[-1])[:2]) < 0.02


@pytest.mark.parametrize(
    ("gained", "lost", "preferred"), [(7, 0, True), (6, 0, False), (0, 7, False), (25, 8, True), (20, 8, False)]
)
def test_beams_prefer_the_pose_that_fewer_of_them_contradict(monkeypatch, gained, lost, preferred):
    """Eq. M91 with the quantile 6.63; beams that are judged alike, or of which nothing is known, do not count."""
    alike = [ON] * 9 + [THROUGH] * 9 + [UNKNOWN] * 9
    here = np.array([THROUGH, BEFORE] * gained + [ON] * lost + alike)[gained:]
    there = np.array([ON] * gained + [BEFORE] * lost + alike)
    fit, other = (Registration(pose(x), np.eye(3), np.zeros(3), share) for x, share in ((0.0, 0.6), (1.0, 0.7)))
    odometry = copy.deepcopy(_under_way()[0])

    def judge_beams(scan, walls, pose_map_robot, rules):
        return there if pose_map_robot[0] else here

    monkeypatch.setattr("slam.odometry.line_odometry.judge_beams", judge_beams)
    assert odometry._beams_prefer(odometry.scan, other.pose_map_robot, fit) == preferred
    assert odometry._explains_better(odometry.scan, other, fit) == preferred
    assert not odometry._explains_better(odometry.scan, dataclasses.replace(other, share=0.6), fit)


@pytest.mark.parametrize("turn_deg", [10.4, -10.4])
@pytest.mark.parametrize(("share", "believed"), [(0.3, False), (0.6, True)])
def test_little_that_fits_does_not_turn_the_robot_away_from_long_walls(monkeypatch, turn_deg, share, believed):
    """A first look is turned by something near, inside of the gate of the wheels and with a claim of 0.1 deg.

    The walls of the room, seen from where the wheels say, contradict it. They are asked where little fits.
    """
    here, turn = pose(2.2, 1.7, 0.6), math.radians(turn_deg)
    scan = LIDAR.scan(room(), here, 0.0, np.random.default_rng(9))
    lines = extract(scan, SENSOR, CONFIG.extraction).lines
    motion = Told((pose(), np.zeros((3, 3))), (pose(), np.diag([0.02, 0.02, math.radians(4.0)]) ** 2))
    odometry = LineOdometry(here, motion, SENSOR, LINE_DISTANCE, 1)
    odometry.predict(0.0, pose())
    odometry.register(0.0, scan, lines)
    odometry.add_key_frame()
    looks = []

    def feign(*arguments):
        looks.append(register(*arguments))
        information = np.diag([1e4, 1e4, math.radians(0.1) ** -2])
        turned = Registration(here + pose(0.0, 0.0, turn), information, information @ pose(0.0, 0.0, turn), share)
        return turned if len(looks) == 1 else looks[-1]

    monkeypatch.setattr("slam.odometry.line_odometry.register", feign)
    odometry.predict(1.0, pose())
    odometry.register(1.0, scan, lines)
    assert odometry.counts.registered == 1
    turned = math.degrees(wrap_angle(float(odometry.pose[2] - here[2])))
    assert turned == pytest.approx(turn_deg if believed else 0.0, abs=0.3)


@pytest.mark.slow
def test_wheels_that_stop_reporting_are_not_believed():
    """The odometry stands still for four seconds while the robot goes on."""
    run = room_run(4)
    frames = [
        Frame(frame.stamp, run.poses_odom_robot[600] if 600 <= index < 800 else frame.pose_odom_robot, frame.scan)
        for index, frame in zip(range(1200), run, strict=False)
    ]
    _, _, odometry = follow(frames, run.poses_world_robot[:1200], config_of(run))
    assert np.hypot(*(odometry.pose - run.poses_world_robot[1199])[:2]) < 0.05


def test_scans_of_nothing_leave_the_prediction():
    run = room_run(5)
    nothing = LaserScan(np.full(920, math.inf), np.linspace(-3.1, 3.1, 920))
    frames = [
        Frame(frame.stamp, frame.pose_odom_robot, nothing if frame.scan is not None else None)
        for _, frame in zip(range(400), run, strict=False)
    ]
    _, covs, odometry = follow(frames, run.poses_world_robot[:400], config_of(run))
    np.testing.assert_allclose(odometry.pose, run.poses_odom_robot[399], atol=1e-9)
    wheels = followed_by_wheels(frames, config_of(run))
    np.testing.assert_allclose(covs, wheels, rtol=1e-6, atol=1e-12)


def followed_by_wheels(frames, config):
    """Covariances of the increments between key frames by wheels alone."""
    odometry = line_odometry(config, frames[0].pose_odom_robot)
    anchor = odometry.clone()
    covs = []
    for index, frame in enumerate(frames):
        odometry.predict(frame.stamp, frame.pose_odom_robot)
        if frame.scan is not None and (index == 0 or anchor.travel >= 0.3 or anchor.turn >= math.radians(15.0)):
            covs += [anchor.motion_cov] if index else []
            anchor.reset()
    return covs


def test_standing_still_makes_nothing_surer():
    """A hundred scans from one place know the errors of the walls no better than one."""
    run = room_run(6)
    config = config_of(run)
    frames = list(zip(run, run.poses_world_robot, strict=True))[:500]
    last = max(index for index, (frame, _) in enumerate(frames) if frame.scan is not None)
    _, _, odometry = follow([f for f, _ in frames[: last + 1]], [t for _, t in frames[: last + 1]], config)
    frame, truth = frames[last]
    since = odometry.clone()
    sensor = config.sensor.model()
    rng = np.random.default_rng(0)
    before = odometry.pose.copy()
    for k in range(100):
        scan = run.lidar.scan(run.world, truth, 1.0, rng)
        odometry.predict(frame.stamp + 0.1 * k, frame.pose_odom_robot)
        odometry.register(frame.stamp + 0.1 * k, scan, extract(scan, sensor, config.extraction).lines)
    np.testing.assert_allclose(since.motion_cov, np.zeros((3, 3)), atol=1e-15)
    np.testing.assert_array_equal(odometry.pose, before)


class Told:
    """Motions that are told, with their covariances."""

    def __init__(self, *motions):
        self._motions = iter(motions)
        self.jumps, self.pose_odom, self.pose_log = [], pose(), pose()

    def record(self, stamp, pose_log_robot):
        return next(self._motions)

    def learn(self, stamp, since):
        return False


@pytest.mark.parametrize("unsure", range(3), ids=["ahead", "across", "turn"])
def test_a_motion_that_one_coordinate_alone_leaves_open_is_corrected_by_the_scan(unsure):
    """The two others are known better than any scan could tell; the robot stands, and is told a motion of that one."""
    here, sigmas = pose(2.2, 1.7, 0.6), np.full(3, 1e-4)
    sigmas[unsure] = 0.05
    error = np.where(np.arange(3) == unsure, 0.05, 0.0)
    scan = LIDAR.scan(room(), here, 0.0, np.random.default_rng(9))
    lines = extract(scan, SENSOR, CONFIG.extraction).lines
    motion = Told((pose(), np.zeros((3, 3))), (error, np.diag(sigmas**2)))
    odometry = LineOdometry(here, motion, SENSOR, LINE_DISTANCE, 1)
    for stamp in (0.0, 1.0):
        odometry.predict(stamp, pose())
        odometry.register(stamp, scan, lines)
        odometry.add_key_frame()
    np.testing.assert_allclose(odometry.pose, here, atol=0.005)


def test_from_one_place_a_scan_corrects_once_however_uncertain_the_way_there_was():
    """Along a bare corridor no scan ever tells how far the robot has come."""
    rng = np.random.default_rng(10)
    way = np.diag([1.0, 0.01, 0.01]) ** 2
    motion = Told((pose(), way), (pose(), 0.05**2 * np.eye(3)), (pose(), np.zeros((3, 3))))
    odometry = LineOdometry(pose(), motion, SENSOR, LINE_DISTANCE, 1)
    poses = []
    for stamp in (0.0, 1.0, 2.0):
        scan = LIDAR.scan(CORRIDOR, pose(), stamp, rng)
        odometry.predict(stamp, pose())
        odometry.register(stamp, scan, extract(scan, SENSOR, CONFIG.extraction).lines)
        poses.append(odometry.pose.copy())
        odometry.add_key_frame()
    assert (poses[1] != poses[0]).any()
    np.testing.assert_array_equal(poses[2], poses[1])


def test_odometry_beyond_all_numbers_is_a_divergence():
    run = room_run(1)
    odometry = line_odometry(config_of(run), pose())
    odometry.predict(0.0, pose())
    odometry.predict(1.0, pose(1e200))
    with pytest.raises(DivergedError, match="no longer finite"), np.errstate(all="ignore"):
        odometry.predict(2.0, pose())


@pytest.mark.parametrize(
    ("far", "near", "outcome"),
    [(0.9, 0.8, "slipped"), (0.75, 0.8, "near"), (0.3, 0.8, "near"), (0.3, 0.4, "failed"), (0.9, 0.4, "slipped")],
)
def test_a_scan_is_believed_against_the_prediction_only_where_it_fits_better(monkeypatch, far, near, outcome):
    """Walls that look alike, 0.8 m further on; the first look has a wide gate and is carried there."""
    run = room_run(6)
    frames = [frame for _, frame in zip(range(100), run, strict=False)]
    _, _, odometry = follow(frames, run.poses_world_robot[:100], config_of(run))
    scan = next(frame.scan for frame in reversed(frames) if frame.scan is not None)
    config = config_of(run)
    # A motion, as a scan from where the last one was taken is left out.
    odometry.predict(frames[-1].stamp + 0.4, compose(frames[-1].pose_odom_robot, np.array([0.2, 0.0, 0.0])))
    predicted = odometry.pose
    looks = iter([(0.8, 0.7), (0.001, near), (0.8, far)])

    def register(scan, walls, prior, prior_cov, start, rules):
        step, share = next(looks)
        information = 1e6 * np.eye(3)
        pull = information @ np.array([step, 0.0, 0.0])
        moved = np.linalg.solve(np.eye(3) + prior_cov @ information, prior_cov @ pull)
        return Registration(prior + moved, information, pull, share)

    monkeypatch.setattr("slam.odometry.line_odometry.register", register)
    odometry.register(frames[-1].stamp + 0.4, scan, extract(scan, config.sensor.model(), config.extraction).lines)
    assert next(looks, None) is None
    moved = float(np.hypot(*(odometry.pose - predicted)[:2]))
    assert moved == pytest.approx({"slipped": 0.8, "near": 0.001, "failed": 0.0}[outcome], abs=0.01)
    assert odometry.counts.predictions_rejected == (outcome == "slipped")
    assert odometry.counts.failed == (outcome == "failed")


@pytest.mark.parametrize(
    ("through_here", "through_there", "distance", "believed"),
    [(0, 5, 0.01, False), (3, 3, 0.01, False), (20, 5, 0.01, True), (20, 5, 0.5, True)],
)
def test_what_looks_more_alike_elsewhere_is_believed_where_fewer_beams_go_through_walls(
    monkeypatch, through_here, through_there, distance, believed
):
    """Little of the scan lies on walls, 0.8 m further on more of it; ``distance`` is how far the fit here has moved."""
    run = room_run(6)
    frames = [frame for _, frame in zip(range(100), run, strict=False)]
    _, _, odometry = follow(frames, run.poses_world_robot[:100], config_of(run))
    scan = next(frame.scan for frame in reversed(frames) if frame.scan is not None)
    odometry.predict(frames[-1].stamp + 0.4, compose(frames[-1].pose_odom_robot, np.array([0.2, 0.0, 0.0])))
    predicted = odometry.pose
    looks = iter([(distance, 0.3)])

    def register(scan, walls, prior, prior_cov, start, rules):
        step, share = next(looks, (0.8, 0.7))
        information = 1e6 * np.eye(3)
        pull = information @ np.array([step, 0.0, 0.0])
        moved = np.linalg.solve(np.eye(3) + prior_cov @ information, prior_cov @ pull)
        return Registration(prior + moved, information, pull, share)

    def beams_through_walls(scan, walls, pose_map_robot, rules):
        return through_here if math.hypot(*(pose_map_robot - predicted)[:2]) < 0.4 else through_there

    monkeypatch.setattr("slam.odometry.line_odometry.register", register)
    monkeypatch.setattr("slam.odometry.line_odometry.beams_through_walls", beams_through_walls)
    sensor = config_of(run).sensor.model()
    odometry.register(frames[-1].stamp + 0.4, scan, extract(scan, sensor, config_of(run).extraction).lines)
    moved = float(np.hypot(*(odometry.pose - predicted)[:2]))
    assert moved == pytest.approx(0.8 if believed else 0.01, abs=0.02)
    assert odometry.counts.predictions_rejected == believed


@pytest.mark.slow
def test_a_real_log_backwards_in_time_shows_no_jump():
    """The robot backs out of passages: most of what it sees there is new, and looks like what it saw before."""
    path = DATA / "intel-lab.clf.gz"
    if not path.is_file():
        pytest.skip(f"{path} is absent: set CWLF_DATA to the folder of the real logs")
    log = CarmenLog(path)
    config = SlamConfig.of_preset(log.sensor)
    sensor = config.sensor.model()
    frames = list(log)
    end = frames[-1].stamp
    odometry = line_odometry(config, frames[-1].pose_odom_robot)
    since = odometry.clone()
    stamps, poses = [], []
    for frame in reversed(frames):
        if end - frame.stamp > 200.0:
            break
        odometry.predict(end - frame.stamp, frame.pose_odom_robot)
        if frame.scan is not None:
            odometry.register(end - frame.stamp, frame.scan, extract(frame.scan, sensor, config.extraction).lines)
            if since.moved_beyond(
                config.back_end.key_frame_distance_m, math.radians(config.back_end.key_frame_angle_deg)
            ):
                odometry.add_key_frame()
                since.reset()
        stamps.append(end - frame.stamp)
        poses.append(odometry.pose)
    truth = read_relations(DATA / "intel-lab.relations")
    ends = end - np.stack([truth.stamps_from, truth.stamps_to])
    near = (ends <= stamps[-1]).all(axis=0) & (np.abs(ends[1] - ends[0]) < 20.0)
    there = Relations(*ends[:, near], truth.poses_from_to[near])
    trajectory = Trajectory(np.array(stamps), np.array(poses))
    errors = [
        relations(Relations(*(part[k : k + 1] for part in astuple(there))), trajectory).translation_mean_m
        for k in range(near.sum())
    ]
    assert len(errors) > 30
    assert max(errors) < 0.3


@cache
def _under_way():
    run = room_run(6)
    frames = [frame for _, frame in zip(range(100), run, strict=False)]
    _, _, odometry = follow(frames, run.poses_world_robot[:100], config_of(run))
    scan = next(frame.scan for frame in reversed(frames) if frame.scan is not None)
    return odometry, frames[-1], scan, config_of(run)


def scanned_after(motion, monkeypatch, register_):
    """Drive, report a motion and register the latest scan again with ``register_``: odometry and what it was before.

    Returns the odometry, an anchor of before the motion, and the prediction: its pose and the anchor's covariance.
    """
    odometry, last, scan, config = copy.deepcopy(_under_way())
    anchor = odometry.clone()
    odometry.predict(last.stamp + 0.4, compose(last.pose_odom_robot, motion))
    predicted = odometry.pose, anchor.motion_cov
    monkeypatch.setattr("slam.odometry.line_odometry.register", register_)
    odometry.register(last.stamp + 0.4, scan, extract(scan, config.sensor.model(), config.extraction).lines)
    return odometry, anchor, predicted


def feigned(looks):
    """A registration that finds a step along x from its prior, and a share: each of ``looks`` in turn."""
    looks = iter(looks)

    def register(scan, walls, prior, prior_cov, start, rules):
        step, share = next(looks)
        information = 1e6 * np.eye(3)
        pull = information @ np.array([step, 0.0, 0.0])
        moved = np.linalg.solve(np.eye(3) + prior_cov @ information, prior_cov @ pull)
        return Registration(prior + moved, information, pull, share)

    return register


def test_a_slip_that_is_not_confirmed_leaves_the_prediction_and_widens_its_covariance(monkeypatch):
    """The first look fits 0.8 m further on, the second neither there nor beside the prediction: it may have slipped.

    The covariance grows by the outer product of the slip (eq. M32), which the anchor tells in its own axes.
    """
    register = feigned([(0.8, 0.7), (0.001, 0.3), (0.8, 0.3)])
    odometry, anchor, (predicted, cov) = scanned_after(pose(0.2), monkeypatch, register)
    assert odometry.counts.failed == 1
    np.testing.assert_array_equal(odometry.pose, predicted)
    heading = wrap_angle(float(odometry.pose[2] - anchor.motion[2]))
    wider = anchor.motion_cov - cov
    # The feigned look is a compromise with the prediction: short of 0.8 m by its part of the information, 2 % here.
    size = math.sqrt(np.trace(wider))
    assert size == pytest.approx(0.8, rel=0.05)
    slip = size * np.array([math.cos(heading), -math.sin(heading), 0.0])
    np.testing.assert_allclose(wider, np.outer(slip, slip), atol=0.02 * size**2)


def test_after_a_slip_the_robot_is_where_the_registration_puts_it(monkeypatch):
    """The wheels tell of 0.3 m that were not driven, far beyond their covariance.

    The slip enlarges the covariance (eq. M32) for the registration and for the pose alike. Both are one Gaussian
    posterior in two forms, so they agree to rounding; with the covariance of before the pose would stay 0.1 mm behind.
    """
    fits = []

    def spy(*arguments):
        fits.append(register(*arguments))
        return fits[-1]

    odometry, _, (predicted, _) = scanned_after(pose(0.3), monkeypatch, spy)
    assert odometry.counts.predictions_rejected == 1
    assert np.hypot(*(odometry.pose - predicted)[:2]) > 0.25
    np.testing.assert_allclose(odometry.pose, fits[-1].pose_map_robot, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("here", [0.3, 0.35, 0.4])
@pytest.mark.parametrize(("more", "believed"), [(0.02, False), (0.1, False), (0.25, True)])
def test_another_pose_is_preferred_only_where_clearly_more_points_lie_on_walls(monkeypatch, here, more, believed):
    """Elsewhere fewer beams go through walls, and the share is larger by as much: a few points more are chance."""
    looks = [(0.01, here), *[(0.8, here + more)] * 20]

    def beams_through_walls(scan, walls, pose_map_robot, rules):
        return 20 if math.hypot(*(pose_map_robot - _under_way()[0].pose)[:2]) < 0.5 else 5

    monkeypatch.setattr("slam.odometry.line_odometry.beams_through_walls", beams_through_walls)
    odometry, _, (predicted, _) = scanned_after(pose(0.2), monkeypatch, feigned(looks))
    moved = float(np.hypot(*(odometry.pose - predicted)[:2]))
    assert moved == pytest.approx(0.8 if believed else 0.01, abs=0.02)
