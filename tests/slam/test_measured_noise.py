"""A run with the noise that its scans show, from end to end."""

import dataclasses
import itertools
import logging
import pickle

import numpy as np
import pytest

from sim import Lidar, find_site, site_run
from slam.config_file import load_config
from slam.pipeline import Slam


def frames_of(sigma, scans=40):
    lidar = dataclasses.replace(Lidar.of_preset("rplidar-s1"), sigma_range=sigma)
    run = site_run(find_site("random-room-3"), lidar, "rplidar-s1", 5)
    return list(itertools.islice(run, 5 * scans))


def config_of(noise="measured", sigma_mm=10.0):
    config = load_config(None, preset="rplidar-s1")
    update = {"noise": noise, "sigma_range_mm": sigma_mm}
    return config.model_copy(update={"sensor": config.sensor.model_copy(update=update)})


def run_of(frames, config):
    slam = Slam(config)
    return slam, [slam.process(frame) for frame in frames]


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.005, 0.04])
def test_a_run_of_a_wrong_preset_is_one_of_the_right_noise(sigma):
    frames = frames_of(sigma)
    slam, steps = run_of(frames, config_of())
    again = [step for step in steps if step.before]
    assert len(again) == 1
    noise = slam.finish().metrics.noise
    assert noise is not None
    assert noise.in_use_mm == pytest.approx(1e3 * sigma, rel=0.05)
    right, as_given = run_of(frames, config_of("given", noise.in_use_mm))
    # From the first frame on, and to the last bit.
    number = len(again[0].before)
    for done, expected in zip([*again[0].before, *steps[number:]], as_given, strict=True):
        np.testing.assert_array_equal(done.pose_world_robot, expected.pose_world_robot)
    np.testing.assert_array_equal(slam.landmarks, right.landmarks)
    assert slam.trust.ok


@pytest.mark.slow
def test_given_noise_stays_and_is_contradicted(caplog):
    slam, steps = run_of(frames_of(0.04), config_of("given"))
    assert not any(step.before for step in steps)
    assert [reason.what for reason in slam.trust.reasons][:1] == ["noise"]
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        better, _ = run_of(frames_of(0.004), config_of("given"))
    assert better.trust.ok
    assert sum("would use it" in message for message in caplog.messages) == 1


def test_a_run_that_ends_before_the_start_does_uses_what_it_has():
    slam, steps = run_of(frames_of(0.04, 6), config_of())
    assert not any(step.before for step in steps)
    result = slam.finish()
    noise = result.metrics.noise
    assert noise is not None
    assert noise.scans == result.metrics.scans == 6
    assert noise.in_use_mm == pytest.approx(40.0, rel=0.1)


@pytest.mark.slow
def test_a_run_pickled_in_its_start_goes_on_as_it_would():
    frames = frames_of(0.03, 20)
    slam, _ = run_of(frames[:30], config_of())
    other = pickle.loads(pickle.dumps(slam))
    for frame in frames[30:]:
        slam.process(frame)
        other.process(frame)
    np.testing.assert_array_equal(slam.pose, other.pose)
    np.testing.assert_array_equal(slam.landmarks, other.landmarks)
    assert slam.finish().metrics.noise == other.finish().metrics.noise
