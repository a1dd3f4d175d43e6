"""The folder of a run: claimed before it, written at its end, and read back as it was."""

import itertools
import json
import math
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from drivers.frame import SourceInfo
from features.se2 import wrap_angle
from sim import room_run
from slam.config_file import load_config
from slam.errors import RunFolderError
from slam.pipeline import Slam
from slam.result.trajectory_file import TrajectoryFormatError
from slam.run.folder import TRAJECTORIES, claimed, default_folder, read_landmarks, read_trajectory, save_run


@pytest.fixture(scope="module")
def result():
    source = room_run(2)
    slam = Slam(load_config(None, source=source.info))
    for frame in itertools.islice(source, 300):
        slam.process(frame)
    return slam.finish()


@pytest.fixture(scope="module")
def saved(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "of" / "a day"
    save_run(folder, result)
    return folder


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_what_is_read_back_is_what_the_run_yielded(result, saved):
    written = {
        "final": result.trajectory,
        "online": result.trajectory_online,
        "odometry": result.trajectory_odometry,
    }
    assert set(written) == set(TRAJECTORIES)
    for which, trajectory in written.items():
        back = read_trajectory(saved, which)
        # As precise as the file: microseconds, and 1e-9 of a coordinate, which a heading is twice the angle of.
        np.testing.assert_allclose(back.stamps, trajectory.stamps, rtol=0.0, atol=0.51e-6)
        np.testing.assert_allclose(back.poses[:, :2], trajectory.poses[:, :2], rtol=0.0, atol=0.51e-9)
        np.testing.assert_allclose(wrap_angle(back.poses[:, 2] - trajectory.poses[:, 2]), 0.0, atol=4e-9)
    assert len(result.trajectory_online) < len(result.trajectory)
    positions, identities = read_landmarks(saved)
    assert len(positions) > 3
    np.testing.assert_allclose(positions, result.landmarks.positions, rtol=0.0, atol=0.51e-6)
    np.testing.assert_array_equal(identities, result.landmarks.identities)


def test_configuration_and_figures_are_those_of_the_run(result, saved):
    assert load_config(saved / "config.toml", source=SourceInfo("hall", "sick-lms")) == result.config
    metrics = json.loads((saved / "metrics.json").read_text(encoding="utf-8"))
    assert metrics == json.loads(json.dumps(result.metrics.to_dict()))
    assert metrics["landmarks"] == len(result.landmarks)
    assert (saved / "map.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_the_same_result_gives_the_same_bytes_and_replaces_what_was_there(result, saved, tmp_path):
    other = tmp_path / saved.name
    other.mkdir()
    for name in names(saved):
        (other / name).write_text("left over")
    (other / "notes.txt").write_text("mine")
    save_run(other, result)
    assert names(other) == sorted([*names(saved), "notes.txt"])
    for name in names(saved):
        assert (other / name).read_bytes() == (saved / name).read_bytes()
    assert (other / "notes.txt").read_text() == "mine"


def test_the_folder_of_a_run_bears_its_name_and_date_and_no_sign_that_a_file_system_dislikes():
    folder = default_folder("my log/of: today", datetime(2024, 2, 3, 4, 5, 6))
    assert folder == Path("runs") / "my-log-of-today-2024-02-03-040506"


def test_a_folder_is_made_with_its_parents_and_nothing_is_left_in_it(tmp_path):
    wanted = tmp_path / "a" / "b"
    with claimed(wanted, overwrite=False) as folder:
        assert folder == wanted
        assert names(folder) == []
        (folder / "result").touch()
    assert names(wanted) == ["result"]


def test_an_empty_folder_may_be_claimed_and_one_that_holds_something_only_to_be_overwritten(tmp_path):
    with claimed(tmp_path, overwrite=False):
        pass
    (tmp_path / "result").write_text("old")
    with pytest.raises(RunFolderError, match=r"is not empty.*--overwrite"), claimed(tmp_path, overwrite=False):
        pytest.fail("it was claimed")
    with claimed(tmp_path, overwrite=True):
        assert (tmp_path / "result").read_text() == "old"


def test_a_folder_that_cannot_be_made_is_told_before_the_run(tmp_path):
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(RunFolderError, match="cannot be used as run folder"), claimed(folder, overwrite=True):
            pytest.fail("it was claimed")


def test_a_folder_that_cannot_be_written_to_is_told_before_the_run(tmp_path, monkeypatch):
    def denied(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "touch", denied)
    with pytest.raises(RunFolderError, match="run folder: Permission denied"), claimed(tmp_path, overwrite=False):
        pytest.fail("it was claimed")


def failing_run(folder, error, leaves):
    with claimed(folder, overwrite=False):
        for name in leaves:
            (folder / name).touch()
        raise error


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_after_an_error_an_empty_folder_goes_again_if_it_was_made_for_the_run(tmp_path, error):
    mine, made, used = tmp_path / "mine", tmp_path / "made", tmp_path / "used"
    mine.mkdir()
    for folder in (mine, made, used):
        with pytest.raises(error):
            failing_run(folder, error, leaves=["checkpoint"] if folder == used else [])
    assert names(tmp_path) == ["mine", "used"]
    assert names(used) == ["checkpoint"]


def test_what_cannot_be_written_is_an_error_that_names_the_folder(tmp_path, result):
    (tmp_path / "file").touch()
    with pytest.raises(RunFolderError, match=r"file.*cannot be written"):
        save_run(tmp_path / "file" / "run", result)
    (tmp_path / "run" / "trajectory.tum").mkdir(parents=True)
    with pytest.raises(RunFolderError, match="run: cannot be written"):
        save_run(tmp_path / "run", result)


def test_what_is_no_run_folder_says_so(tmp_path):
    with pytest.raises(RunFolderError, match="no such run folder"):
        read_trajectory(tmp_path / "absent")
    (tmp_path / "file").touch()
    with pytest.raises(RunFolderError, match="is a file, not a run folder"):
        read_trajectory(tmp_path / "file")
    with pytest.raises(RunFolderError, match=r"holds no trajectory_online\.tum"):
        read_trajectory(tmp_path, "online")
    with pytest.raises(RunFolderError, match="cannot be read"):
        read_landmarks(tmp_path)


@pytest.mark.parametrize("table", ["id,x\n0,1.0\n", "x,y,identity\n1.0,north,\n", "x,y,identity\n1.0\n"])
def test_damaged_files_of_a_run_are_told(tmp_path, table):
    (tmp_path / "landmarks.csv").write_text(table)
    with pytest.raises(RunFolderError, match="expected columns x, y and identity"):
        read_landmarks(tmp_path)
    (tmp_path / "trajectory.tum").write_text("0.0 nowhere\n")
    with pytest.raises(TrajectoryFormatError):
        read_trajectory(tmp_path)


def test_a_run_without_landmarks_has_an_empty_table(tmp_path, saved):
    header = (saved / "landmarks.csv").read_text().splitlines()[0]
    (tmp_path / "landmarks.csv").write_text(header + "\n")
    positions, identities = read_landmarks(tmp_path)
    assert (positions.shape, identities.shape) == ((0, 2), (0,))
    (tmp_path / "landmarks.csv").write_text(header + "\n7,1.5,-2.5,,,,,,,0\n8,0.0,0.0,,,,,,,\n")
    positions, identities = read_landmarks(tmp_path)
    assert positions.tolist() == [[1.5, -2.5], [0.0, 0.0]]
    # Identity 0 is one; none is -1.
    assert identities.tolist() == [0, -1]
    assert not math.isnan(positions.sum())
