"""The whole pipeline on simulated runs with known truth, on odd inputs, and on a real log."""

import itertools
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from places import DATA

from drivers.carmen.log import CarmenLog
from drivers.frame import Frame
from features.extraction import extract
from features.scan import LaserScan
from features.se2 import compose, pose, transform
from features.sensor import Mounting
from sim import SimulatedRun, room_run
from sim.motion.odometry import WheelOdometry
from sim.motion.robot import Robot
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from sim.worlds.world import World
from slam.config import SlamConfig
from slam.config_file import load_config
from slam.errors import DivergedError
from slam.evaluation.metrics import ate, match_landmarks
from slam.evaluation.relations import Relations, read_relations, relations
from slam.graph.incremental import LandmarkGraph
from slam.pipeline import Slam
from slam.result.result import SlamResult
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import write_tum


def config_for(source, mounting=None):
    return load_config(None, source=replace(source.info, mounting=mounting or source.mounting))


def processed(frames, config) -> SlamResult:
    slam = Slam(config)
    for frame in frames:
        slam.process(frame)
    return slam.finish()


@cache
def mapped_room(seed):
    source = room_run(seed)
    return source, processed(source, config_for(source))


def accuracy(source, result):
    """ATE [m], landmark RMSE after the alignment of the trajectory [m], and the corners of the world on the map."""
    absolute = ate(Trajectory(source.stamps, source.poses_world_robot), result.trajectory)
    landmarks = transform(absolute.pose_truth_estimate, result.landmarks.positions)
    pairs = match_landmarks(source.world.corners, landmarks, 0.3)
    errors = np.linalg.norm(source.world.corners[pairs[:, 0]] - landmarks[pairs[:, 1]], axis=1)
    rmse = float(np.sqrt(np.mean(errors**2))) if len(pairs) else math.inf
    return absolute.rmse_m, rmse, set(pairs[:, 0].tolist())


def often_seen_corners(source, least=20):
    """Corners of the world that at least so many scans show where they are; told by the truth, without any SLAM.

    Twenty scans are a metre at full speed: ten updates of the filter and three key frames.
    """
    model = config_for(source).sensor.model()
    counts = np.zeros(len(source.world.corners), np.int64)
    for frame, truth in zip(source, source.poses_world_robot, strict=True):
        if frame.scan is None:
            continue
        corners = extract(frame.scan, model, SlamConfig.of_preset(source.sensor).extraction).corners
        seen = transform(truth, corners.to_robot(model.mounting).positions)
        counts[np.unique(match_landmarks(source.world.corners, seen, 0.1)[:, 0])] += 1
    return set(np.flatnonzero(counts >= least).tolist())


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_room_is_mapped_to_centimetres(seed):
    source, result = mapped_room(seed)
    ate_m, landmark_m, corners = accuracy(source, result)
    assert ate_m < 0.05
    assert landmark_m < 0.03
    assert often_seen_corners(source) <= corners
    # Nothing is on the map that is not in the room, and nothing twice.
    assert len(result.landmarks) == len(corners)
    # Odometry alone is an order of magnitude worse: the landmarks made the difference.
    assert ate(Trajectory(source.stamps, source.poses_world_robot), result.wheel_odometry).rmse_m > 0.3


@pytest.mark.slow
def test_the_second_sensor_preset_maps_the_room_too():
    source = room_run(3, preset="sick-lms")
    ate_m, landmark_m, _ = accuracy(source, processed(source, config_for(source)))
    assert ate_m < 0.05
    assert landmark_m < 0.03


MOUNTINGS = {
    "offset": Mounting(x=0.25, y=-0.1, theta=0.0),
    "backwards": Mounting(x=-0.2, y=0.05, theta=math.pi),
    "upside down": Mounting(x=0.1, y=0.1, theta=0.4, upside_down=True),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MOUNTINGS)
def test_the_mounting_is_honoured(name):
    """Told where the sensor sits, a lap maps the room as well as ever; told that it sits at the origin, it does not.

    Misled, the scans still tell the motion of the sensor; the trajectory is wrong by as much as that differs.
    """
    source = room_run(1, mounting=MOUNTINGS[name])
    lap = list(itertools.islice(source, 1500))
    ate_m, landmark_m, corners = accuracy(source, processed(lap, config_for(source)))
    assert ate_m < 0.05
    assert landmark_m < 0.03
    ate_misled_m, _, corners_misled = accuracy(source, processed(lap, config_for(source, Mounting())))
    assert ate_misled_m > 20.0 * ate_m
    assert len(corners_misled) <= 0.75 * len(corners)


@pytest.mark.slow
def test_landmark_covariances_are_as_large_as_the_errors():
    """99 % gate over the landmarks of two runs, in the frame of the first pose, which both know."""
    distances2 = []
    for seed in (1, 2):
        source, result = mapped_room(seed)
        pairs = match_landmarks(source.world.corners, result.landmarks.positions, 0.3)
        errors = result.landmarks.positions[pairs[:, 1]] - source.world.corners[pairs[:, 0]]
        covs = result.landmarks.covs[pairs[:, 1]]
        distances2 += [e @ np.linalg.solve(c, e) for e, c in zip(errors, covs, strict=True)]
    # Landmarks of a run share the errors of its poses; over two runs the mean of 2 is known to no better than a factor.
    assert 0.5 < np.mean(distances2) < 6.0


def test_a_result_fits_together():
    source, result = mapped_room(1)
    metrics, landmarks = result.metrics, result.landmarks
    np.testing.assert_array_equal(result.trajectory.stamps, source.stamps)
    np.testing.assert_array_equal(result.trajectory_online.stamps, source.stamps[source.has_scan])
    np.testing.assert_array_equal(result.wheel_odometry.poses, source.poses_odom_robot)
    assert (metrics.records, metrics.scans) == (len(source), source.has_scan.sum())
    assert metrics.landmarks == len(landmarks) == len(landmarks.to_csv().splitlines()) - 1
    assert metrics.duration_s == pytest.approx(source.stamps[-1])
    assert set(metrics.stages) == {"extract", "odometry", "front_end", "back_end", "loop"}
    assert metrics.registrations.registered == metrics.scans - 1
    assert not metrics.interrupted
    assert (landmarks.observations >= 3).all()
    assert (np.linalg.eigvalsh(landmarks.covs) > 0.0).all()
    assert len(set(landmarks.ids.tolist())) == len(landmarks)
    # What was drawn lies in the room: 10 m by 8 m, two decimetres of noise and drift allowed.
    for points in (result.walls.reshape(-1, 2), result.points):
        assert (points > -0.2).all()
        assert (points < [10.2, 8.2]).all()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(tmp_path):
    texts = []
    for name in ("first", "second"):
        frames = itertools.islice(room_run(4), 800)
        result = processed(frames, config_for(room_run(4)))
        for part in ("trajectory", "trajectory_online"):
            write_tum(tmp_path / f"{name}-{part}", getattr(result, part))
        texts.append(
            [(tmp_path / f"{name}-{part}").read_bytes() for part in ("trajectory", "trajectory_online")]
            + [result.landmarks.to_csv()]
        )
    assert texts[0] == texts[1]


@pytest.mark.slow
def test_result_moves_with_the_odometry_frame():
    """The world frame is the odometry frame of the first record: moved by g, everything moves by g."""
    g = pose(20.0, -7.0, 2.0)
    source = room_run(4)
    frames = list(itertools.islice(source, 800))
    moved_frames = [Frame(f.stamp, compose(g, f.pose_odom_robot), f.scan) for f in frames]
    here, there = (processed(each, config_for(source)) for each in (frames, moved_frames))
    expected = np.array([compose(g, each) for each in here.trajectory.poses])
    # The solve of the graph ends at a relative change of 1e-6, which may be another step in another frame.
    np.testing.assert_allclose(there.trajectory.poses[:, :2], expected[:, :2], rtol=0, atol=1e-4)
    np.testing.assert_allclose(there.landmarks.positions, transform(g, here.landmarks.positions), rtol=0, atol=1e-4)
    np.testing.assert_array_equal(there.landmarks.observations, here.landmarks.observations)


CONFIG = SlamConfig.of_preset("rplidar-s1")


def scan_at(truth, world=None, stamp=0.0, seed=0):
    lidar = Lidar.of_preset("rplidar-s1")
    return lidar.scan(world or room(), truth, stamp, np.random.default_rng(seed))


def test_nothing_to_finish_is_a_misuse():
    slam = Slam(CONFIG)
    with pytest.raises(ValueError, match="no scan was processed"):
        slam.finish()
    with pytest.raises(ValueError, match="no frame was processed"):
        _ = slam.pose
    slam.process(Frame(0.0, pose()))
    with pytest.raises(ValueError, match="no scan was processed"):
        slam.finish()


def test_a_single_scan_finishes():
    truth = pose(2.0, 2.0, 0.5)
    result = processed([Frame(1.0, truth, scan_at(truth))], CONFIG)
    np.testing.assert_allclose(result.trajectory.poses, [truth], atol=1e-9)
    assert (len(result.landmarks), result.metrics.key_frames, result.metrics.duration_s) == (0, 1, 0.0)
    assert len(result.points) > 900


def test_a_range_of_zero_is_no_point_whatever_the_least_range():
    sensor = CONFIG.sensor.model_copy(update={"range_min_m": 0.0})
    scan = LaserScan(np.array([0.0, 1.0, 2.0]), np.array([-1.0, 0.0, 1.0]))
    result = processed([Frame(1.0, pose(), scan)], CONFIG.model_copy(update={"sensor": sensor}))
    np.testing.assert_allclose(np.hypot(*result.points.T), [1.0, 2.0])


@pytest.mark.parametrize("empty", ["no beams", "no returns", "one wall"])
def test_scans_without_features_follow_odometry(empty):
    scan = {
        "no beams": LaserScan(np.empty(0), np.empty(0)),
        "no returns": LaserScan(np.full(90, math.inf), np.linspace(-1.0, 1.0, 90)),
        "one wall": scan_at(pose(), World("wall", np.array([[-50.0, 3.0, 50.0, 3.0]]))),
    }[empty]
    # The one wall looks the same from everywhere along it.
    turn = 0.0 if empty == "one wall" else 0.05
    poses = [pose(0.1 * k, 0.0, turn * k) for k in range(60)]
    result = processed([Frame(0.1 * k, each, scan) for k, each in enumerate(poses)], CONFIG)
    # The wall, fitted and registered to by different weights, may move the robot across itself by a hundredth of sigma.
    np.testing.assert_allclose(result.trajectory.poses, poses, atol=1e-3 if empty == "one wall" else 1e-6)
    np.testing.assert_allclose(result.trajectory.poses[:, 0], [x for x, _, _ in poses], atol=1e-6)
    assert len(result.landmarks) == 0
    assert result.metrics.key_frames > 10
    assert len(result.walls) == (result.metrics.key_frames if empty == "one wall" else 0)


def test_standing_still_finishes():
    truth = pose(2.0, 2.0, 0.5)
    frames = [Frame(0.1 * k, truth, scan_at(truth, stamp=0.1 * k, seed=k)) for k in range(30)]
    result = processed(frames, CONFIG)
    np.testing.assert_allclose(result.trajectory.poses, np.tile(truth, (30, 1)), atol=1e-9)
    assert (result.metrics.key_frames, len(result.landmarks)) == (1, 0)


def test_standing_still_may_update_at_every_scan():
    """No motion to predict with, the same corners again and again: the covariance shrinks and stays one."""
    truth = pose(2.0, 2.0, 0.5)
    front_end = CONFIG.front_end.model_copy(update={"update_distance_m": 0.0, "update_angle_deg": 0.0})
    slam = Slam(CONFIG.model_copy(update={"front_end": front_end}))
    for k in range(30):
        step = slam.process(Frame(0.1 * k, truth, scan_at(truth, seed=k)))
    assert step.association is not None
    assert len(step.association.landmarks) > 5
    np.testing.assert_allclose(slam.pose, truth, atol=1e-3)
    assert len(slam.finish().trajectory) == 30


def test_records_of_odometry_only_get_a_pose_before_between_and_after_the_scans():
    poses = [pose(2.0 + 0.05 * k, 2.0, 0.0) for k in range(40)]
    frames = [
        Frame(0.1 * k, each, scan_at(each, seed=k) if 10 <= k < 30 and k % 3 == 0 else None)
        for k, each in enumerate(poses)
    ]
    slam = Slam(CONFIG)
    steps = [slam.process(frame) for frame in frames]
    assert all((step.features is None) == (frame.scan is None) for step, frame in zip(steps, frames, strict=True))
    np.testing.assert_allclose(slam.pose, poses[-1], atol=0.05)
    result = slam.finish()
    assert len(result.trajectory) == 40
    assert slam.scans == len(result.trajectory_online) == 6
    np.testing.assert_allclose(result.trajectory.poses, poses, atol=0.05)


def test_frames_of_equal_stamps_are_taken_in_their_order():
    poses = [pose(2.0 + 0.05 * k, 2.0, 0.0) for k in range(20)]
    frames = [Frame(float(k // 4), each, scan_at(each, seed=k)) for k, each in enumerate(poses)]
    assert len(processed(frames, CONFIG).trajectory) == 20


def test_a_frame_that_comes_too_late_is_refused_at_once_and_changes_nothing():
    slam = Slam(CONFIG)
    slam.process(Frame(5.0, pose(2.0, 2.0), scan_at(pose(2.0, 2.0))))
    with pytest.raises(ValueError, match=r"stamp 4\.5.* is smaller than 5\.0.*: expected frames in order"):
        slam.process(Frame(4.5, pose(2.1, 2.0)))
    slam.process(Frame(5.0, pose(2.1, 2.0)))
    np.testing.assert_allclose(slam.finish().trajectory.poses[:, 0], [2.0, 2.1], atol=1e-9)


@pytest.mark.parametrize(
    ("stamp", "coordinates"),
    [
        (math.nan, [0.0, 0.0, 0.0]),
        (math.inf, [0.0, 0.0, 0.0]),
        (1.0, [0.0, math.nan, 0.0]),
        (1.0, [0.0, 0.0, math.inf]),
    ],
)
def test_a_frame_that_is_not_finite_is_refused_at_once(stamp, coordinates):
    slam = Slam(CONFIG)
    with pytest.raises(ValueError, match="not finite"):
        slam.process(Frame(stamp, np.array(coordinates), scan_at(pose(2.0, 2.0))))
    slam.process(Frame(0.0, pose(2.0, 2.0), scan_at(pose(2.0, 2.0))))
    assert len(slam.finish().trajectory) == 1


def test_a_pose_of_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"expected .*\(3,\)"):
        Slam(CONFIG).process(Frame(0.0, np.zeros(2)))


def test_a_caller_may_reuse_its_pose():
    """A driver that adds to one array in place must not rewrite what was recorded before."""
    slam = Slam(CONFIG)
    here = pose(2.0, 2.0, 0.0)
    for k in range(20):
        slam.process(Frame(0.1 * k, here, scan_at(here, seed=k)))
        here[0] += 0.1
    result = slam.finish()
    np.testing.assert_allclose(result.wheel_odometry.poses[:, 0], 2.0 + 0.1 * np.arange(20))
    np.testing.assert_allclose(result.trajectory.poses[:, 0], 2.0 + 0.1 * np.arange(20), atol=0.05)


def test_results_may_be_taken_while_it_runs():
    """What finish returns is not touched by the frames that follow."""
    source = room_run(4)
    frames = list(itertools.islice(source, 600))
    slam = Slam(config_for(source))
    for frame in frames[:300]:
        slam.process(frame)
    early = slam.finish()
    held = early.trajectory.poses.copy(), early.landmarks.positions.copy(), early.landmarks.observations.copy()
    for frame in frames[300:]:
        slam.process(frame)
    late = slam.finish()
    for was, now in zip(
        held, (early.trajectory.poses, early.landmarks.positions, early.landmarks.observations), strict=True
    ):
        np.testing.assert_array_equal(was, now)
    np.testing.assert_allclose(late.trajectory.poses, processed(frames, config_for(source)).trajectory.poses, atol=1e-9)


def test_a_simulated_run_without_noise_is_exact():
    source = room_run(1)
    lidar = Lidar.of_preset("rplidar-s1")
    exact = Lidar(lidar.angles, 0.0, 0.0, lidar.range_min, lidar.range_max, lidar.rate)
    frames = [
        Frame(stamp, truth, exact.scan(source.world, truth, stamp, np.random.default_rng(0)) if k % 5 == 0 else None)
        for k, (stamp, truth) in enumerate(zip(source.stamps[:800], source.poses_world_robot[:800], strict=True))
    ]
    result = processed(frames, config_for(source))
    np.testing.assert_allclose(result.trajectory.poses[:, :2], source.poses_world_robot[:800, :2], atol=1e-3)


@pytest.mark.slow
def test_the_beginning_of_the_intel_log_runs_through():
    path = DATA / "intel-lab.clf.gz"
    if not path.is_file():
        pytest.skip(f"{path} is absent: set CWLF_DATA to the folder of the real logs")
    source = CarmenLog(path)
    result = processed(itertools.islice(source, 1500), config_for(source))
    assert len(result.trajectory) == 1500
    assert result.metrics.scans > 100
    assert len(result.landmarks) > 5
    truth = read_relations(DATA / "intel-lab.relations")
    within = truth.stamps_to < result.trajectory.stamps[-1]
    short = Relations(truth.stamps_from[within], truth.stamps_to[within], truth.poses_from_to[within])
    # The relations' own stamps are good to centimetres of motion.
    assert relations(short, result.trajectory_odometry).translation_mean_m < 0.05


def test_a_graph_without_solution_leaves_what_was_known_on_the_way(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    source = room_run(4)
    slam = Slam(SlamConfig.of_preset(source.sensor))
    for number, frame in enumerate(source):
        if number == 600:
            break
        slam.process(frame)

    def unsolvable(*arguments: object) -> None:
        raise DivergedError("the graph of 7 key frames has no unique solution")

    monkeypatch.setattr(LandmarkGraph, "optimize", unsolvable)
    result = slam.finish()
    assert not result.metrics.graph_converged
    assert "the result is what was known on the way" in caplog.text
    assert len(result.landmarks) > 5
    truth = Trajectory(source.stamps[:600], source.poses_world_robot[:600])
    assert ate(truth, result.trajectory).rmse_m < 0.05


def test_a_motion_beyond_all_numbers_is_a_divergence():
    slam = Slam(SlamConfig.of_preset("sick-lms"))
    empty = LaserScan(np.full(180, np.inf), np.radians(np.arange(-90.0, 90.0)))
    slam.process(Frame(0.0, pose(), empty))
    with pytest.raises(DivergedError, match="no longer finite"), np.errstate(all="ignore"):
        slam.process(Frame(1.0, pose(1e200), empty))


def ring_run(seed):
    """A lap through the corridor round a block, and its first leg again."""
    outer = np.array([[0.0, 0.0], [16.0, 0.0], [16.0, 10.0], [0.0, 10.0]])
    block = np.array([[2.4, 2.4], [6.0, 2.4], [6.0, 3.0], [13.6, 3.0], [13.6, 7.6], [9.0, 7.6], [9.0, 7.0], [2.4, 7.0]])
    world = World.from_polygons("ring", [outer, block])
    way = [(1.2, 1.2), (14.8, 1.2), (14.8, 8.8), (1.2, 8.8), (1.2, 1.2), (14.8, 1.2)]
    lidar = Lidar.of_preset("rplidar-s1", None)
    return SimulatedRun("ring", world, lidar, "rplidar-s1", Robot().drive(way, 50.0), WheelOdometry(), seed)


@pytest.mark.slow
def test_a_place_seen_again_is_known_again():
    """After a lap and a leg there are as many landmarks as corners, and the end is as good as the beginning."""
    source = ring_run(1)
    frames = [frame for frame in source if frame.scan is not None]
    result = processed(frames[::2], config_for(source))
    ate_m, landmark_m, corners = accuracy(source, result)
    assert ate_m < 0.05
    assert landmark_m < 0.03
    assert len(result.landmarks) == len(corners) == len(source.world.corners)
    assert result.metrics.stages["loop"].mean_ms > 0.0
