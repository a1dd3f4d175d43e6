"""MRCLAM data sets: integration of velocities, identities, and what is wrong with a folder."""

import logging

import numpy as np
import pytest

from drivers import LogFormatError, open_log
from drivers.data_sets.mrclam import MrclamLog, integrate
from features.se2 import compose, pose

FILES = {
    "Barcodes.dat": "# Subject # Barcode #\n 1 5\n 3 41\n 6 63\n 7 81\n",
    "Robot3_Odometry.dat": "0.0 0.5 0.0\n1.0 0.5 0.5\n1.5 0.0 0.0\n",
    "Robot3_Measurement.dat": "0.5 63 2.0 0.1\n0.5 5 1.0 0.0\n1.0 81 3.0 -0.2\n1.0 99 3.0 0.2\n",
    "Robot3_Groundtruth.dat": "0.0 1 2 0.5\n1.0 1.5 2 0.5\n",
    "Landmark_Groundtruth.dat": "6 1.0 2.0 0.001 0.001\n7 3.0 4.0 0.001 0.001\n",
}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def test_frames_are_of_every_stamp_with_the_landmarks_seen_there(folder, caplog):
    with caplog.at_level(logging.WARNING):
        frames = list(open_log(folder))
    assert [frame.stamp for frame in frames] == [0.0, 0.5, 1.0, 1.5]
    # Robots and barcodes that nobody listed are left out, the latter with a warning.
    seen = [None if frame.observations is None else frame.observations.identities.tolist() for frame in frames]
    assert seen == [None, [6], [7], None]
    assert "99" in caplog.text
    np.testing.assert_allclose(frames[1].observations.ranges, [2.0])
    np.testing.assert_allclose(frames[1].pose_odom_robot, [0.25, 0.0, 0.0])


def test_truth_is_beside_the_data(folder):
    log = MrclamLog(folder / "Robot3_Odometry.dat")
    np.testing.assert_allclose(log.truth()[1], [[1, 2, 0.5], [1.5, 2, 0.5]])
    identities, positions = log.true_landmarks()
    assert identities.tolist() == [6, 7]
    np.testing.assert_allclose(positions, [[1, 2], [3, 4]])


def test_velocities_sum_up_to_many_small_steps():
    """The arc in closed form against ten thousand straight steps, which are off by the square of a step."""
    rng = np.random.default_rng(1)
    odometry = np.column_stack([np.cumsum(rng.uniform(0.1, 1.0, 20)), rng.normal(0.0, 0.5, (20, 2))])
    end = odometry[-1, 0] + 1.0
    walked = pose()
    moments = np.linspace(odometry[0, 0], end, 10_001)
    for start, step in zip(moments[:-1], np.diff(moments), strict=True):
        _, speed, rate = odometry[np.searchsorted(odometry[:, 0], start + 0.5 * step, side="right") - 1]
        walked = compose(walked, pose(speed * step, 0.0, rate * step))
    np.testing.assert_allclose(integrate(odometry, np.array([end]))[0], walked, atol=3e-3)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("Robot3_Odometry.dat", "0.0 0.5 0.0\n1.0 x 0.0\n", r"Robot3_Odometry\.dat, line 2: 'x' is no finite number"),
        ("Robot3_Odometry.dat", "1.0 0.5 0.0\n0.5 0.1 0.0\n", r"line 2: stamp goes back by 0\.500 s"),
        ("Robot3_Measurement.dat", "0.5 63 2.0\n", r"Robot3_Measurement\.dat, line 1: 3 fields"),
        ("Robot3_Measurement.dat", "0.5 63 -2.0 0.1\n", r"Robot3_Measurement\.dat: a range is not positive"),
        ("Barcodes.dat", "# nothing\n", r"Barcodes\.dat has no row"),
    ],
)
def test_a_bad_file_is_named_with_its_line(folder, name, text, message):
    (folder / name).write_text(text)
    with pytest.raises(LogFormatError, match=message):
        open_log(folder)


def test_a_missing_file_is_named(folder):
    (folder / "Barcodes.dat").unlink()
    with pytest.raises(LogFormatError, match=r"Barcodes\.dat: no such file"):
        open_log(folder)


def test_the_robot_has_to_be_clear(folder):
    (folder / "Robot4_Odometry.dat").write_text("0 0 0\n")
    with pytest.raises(LogFormatError, match=r"holds robots 3, 4: expected .*Robot3_Odometry\.dat"):
        open_log(folder)
    for name in ("Robot3_Odometry.dat", "Robot4_Odometry.dat"):
        (folder / name).unlink()
    with pytest.raises(LogFormatError, match="no Robot<N>_Odometry"):
        MrclamLog(folder)
