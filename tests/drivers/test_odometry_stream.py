import logging
import os

import numpy as np
import pytest

from drivers.errors import DriverError
from drivers.odometry_stream import OdometryStream


def stream_of(path, text):
    path.write_text(text)
    return OdometryStream(str(path))


def test_pose_is_between_those_before_and_behind(tmp_path):
    odometry = stream_of(tmp_path / "wheels", "10 0 0 3\n12 4 2 -3.1\n")
    turn = 2.0 * np.pi - 6.1
    assert odometry.at(11.0) == pytest.approx([2.0, 1.0, 3.0 + turn / 2.0])
    assert odometry.at(12.0) == pytest.approx([4.0, 2.0, -3.1])


def test_before_the_first_and_behind_the_last_pose_these_stand(tmp_path):
    odometry = stream_of(tmp_path / "wheels", "10 0 0 1\n12 4 2 2\n")
    assert odometry.at(9.0) == pytest.approx([0.0, 0.0, 1.0])
    assert odometry.at(12.5) == pytest.approx([4.0, 2.0, 2.0])


def test_silence_is_said_once_and_its_end_too(tmp_path, caplog):
    path = tmp_path / "wheels"
    os.mkfifo(path)
    odometry = OdometryStream(str(path))
    with path.open("w") as wheels, caplog.at_level(logging.WARNING):
        print("10 0 0 0", file=wheels, flush=True)
        assert odometry.at(20.0) == pytest.approx([0.0, 0.0, 0.0])
        assert odometry.at(21.0) == pytest.approx([0.0, 0.0, 0.0])
        print("22 3 0 0\n23 3 0 0", file=wheels, flush=True)
        wheels.close()
        while odometry.at(23.0)[0] == 0.0:
            pass
    assert [record.message for record in caplog.records] == [
        f"{path}: no odometry for 10.0 s",
        f"{path}: odometry is there again",
    ]


@pytest.mark.parametrize("line", ["", "11 1 1", "11 1 1 1 1", "eleven 1 1 1", "11 nan 1 1", "9 1 1 1"])
def test_line_that_is_no_pose_is_left_out_with_a_warning(tmp_path, caplog, line):
    odometry = stream_of(tmp_path / "wheels", f"10 0 0 0\n{line}\n12 4 2 0\n")
    assert odometry.at(11.0) == pytest.approx([2.0, 1.0, 0.0])
    assert [("line 2: left out" in record.message) for record in caplog.records] == [True]


def test_stream_without_a_pose_is_an_error(tmp_path):
    with pytest.raises(DriverError, match="no odometry came: expected lines of `stamp x y theta`"):
        stream_of(tmp_path / "wheels", "").at(0.0)


def test_file_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(DriverError, match="no such file"):
        OdometryStream(str(tmp_path / "wheels"))
