"""The commands ``world``, ``simulate`` and ``export`` as a user meets them; recordings in ``run`` and ``evaluate``."""

import itertools
import json
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from command_line import Call
from PIL import Image
from places import DATA, ROOT

from drivers import CarmenLog, Frame, Recording
from sim import EFFECTS, ODOMETRIES, Lidar, SimulatedRun, find_site, site_run
from slam.cli.options import EffectsOption, OdometryOption

EXAMPLES = ROOT / "examples"


def world_file(path: Path, *walls: object, **keys: object) -> Path:
    lines = [wall if isinstance(wall, dict) else {"points": wall} for wall in walls]
    path.write_text(json.dumps({"format": "cwlf-world", "version": 1, "walls": lines} | keys))
    return path


SQUARE = {"points": [[0, 0], [5, 0], [5, 5], [0, 5]], "closed": True}


def test_list_names_worlds_that_are_found(cwlf: Call) -> None:
    code, out, _ = cwlf("world", "list")
    assert code == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert {"room", "apartment", "office-loop", "random-room-1"} <= set(names)
    assert "environment-b    3.5 m x 6.0 m, 20 walls, 20 corners" in out


@pytest.mark.slow
@pytest.mark.parametrize("world", ["corridor", "glass"])
def test_show_draws_a_picture(world: str, cwlf: Call, tmp_path: Path) -> None:
    glazed = world_file(tmp_path / "glass.json", SQUARE, {"points": [[2, 2], [3, 2]], "glass": True})
    picture = tmp_path / "pictures" / "world.png"
    code, out, _ = cwlf("world", "show", glazed if world == "glass" else world, "--out", picture)
    assert code == 0
    assert f"picture: {picture}" in out
    with Image.open(picture) as drawn:
        colors = {tuple(color) for color in np.asarray(drawn.convert("RGB")).reshape(-1, 3).tolist()}
    assert ((63, 167, 181) in colors) == (world == "glass")


def test_check_is_silent_on_what_is_right_and_exits_1_on_what_is_not(cwlf: Call, tmp_path: Path) -> None:
    assert cwlf("world", "check", "apartment") == (0, "apartment: 110 walls, nothing wrong\n", "")
    wrong = world_file(tmp_path / "wrong.json", SQUARE, [[1, 1], [2, 2]], [[0, 5], [0, 0]], [[3, 3], [3, 3]])
    code, out, err = cwlf("world", "check", wrong)
    assert code == 1
    assert err == ""
    assert out.splitlines() == [
        "wall 6 has no length: (3, 3) to (3, 3)",
        "walls 3 and 5 are the same: (0, 5) to (0, 0)",
        "wall 4 ends at (1, 1) and meets no other there",
        "wall 4 ends at (2, 2) and meets no other there",
        "wrong: 7 walls, 4 wrong",
    ]


@pytest.mark.slow
def test_a_recording_runs_like_a_log_and_holds_its_truth(cwlf: Call, tmp_path: Path) -> None:
    recording, run = tmp_path / "b.jsonl.gz", tmp_path / "run"
    code, out, err = cwlf("simulate", "--world", "environment-b", "--out", recording, "--seed", 4)
    assert (code, err) == (0, "")
    assert f"recording: {recording}" in out
    assert cwlf("run", recording, "--out", run)[0] == 0
    assert 'preset = "rplidar-s1"' in (run / "config.toml").read_text()
    code, out, _ = cwlf("evaluate", run, "--truth", recording, "--json")
    report = json.loads(out)
    assert report["ate"]["rmse_m"] < 0.05
    assert report["ate"]["count"] == len(list(Recording(recording)))
    assert report["landmarks"]["corners"] == 20
    assert report["landmarks"]["mapped"] >= report["landmarks"]["corners_mapped"] > 10
    assert 0.0 < report["landmarks"]["median_m"] < 0.01
    assert report["landmarks"]["rmse_m"] < 0.05

    again, other = tmp_path / "again.gz", tmp_path / "other.gz"
    cwlf("simulate", "--world", "environment-b", "--out", again, "--seed", 4)
    cwlf("simulate", "--world", "environment-b", "--out", other, "--seed", 5)
    assert again.read_bytes() == recording.read_bytes() != other.read_bytes()


@pytest.mark.slow
def test_a_recording_with_effects_and_people_holds_the_times_of_its_beams_and_runs(cwlf: Call, tmp_path: Path) -> None:
    """S1 effects: a sweep of 0.1 s, whole millimetres and lost beams; ``run`` undoes the motion by the times."""
    recording, run = tmp_path / "r.gz", tmp_path / "run"
    waypoints = np.array(find_site("room").waypoints)[:8]
    np.savetxt(tmp_path / "path.csv", waypoints, delimiter=",")
    options = ("--path", tmp_path / "path.csv", "--effects", "rplidar-s1", "--people", 2, "--odometry", "good")
    assert cwlf("simulate", "--world", "room", "--out", recording, *options)[0] == 0
    frames = list(Recording(recording))
    scans = [frame.scan for frame in frames if frame.scan is not None]
    assert all(scan.times is not None and np.ptp(scan.times) == pytest.approx(0.1, rel=0.01) for scan in scans)
    ranges = np.concatenate([scan.ranges for scan in scans])
    assert 0.0 < np.mean(np.isinf(ranges)) < 0.1
    millimetres = 1e3 * ranges[np.isfinite(ranges)]
    np.testing.assert_allclose(millimetres, np.round(millimetres), atol=1e-6)
    source = site_run(
        find_site("room"),
        Lidar.of_preset("rplidar-s1", effects=EFFECTS["rplidar-s1"]),
        "rplidar-s1",
        1,
        waypoints,
        odometry=ODOMETRIES["good"],
        people=2,
    )
    np.testing.assert_array_equal([frame.pose_odom_robot for frame in frames], source.poses_odom_robot)
    np.testing.assert_allclose(
        scans[100].ranges, next(itertools.islice(source.measurements(), 100, None)).scan.ranges, atol=1e-6
    )
    assert cwlf("run", recording, "--out", run)[0] == 0
    report = json.loads(cwlf("evaluate", run, "--truth", recording, "--json")[1])
    assert report["ate"]["rmse_m"] < 0.05


def test_what_the_options_offer_is_what_there_is() -> None:
    """Spelled out in the command line, so that it need not import the simulator for its help."""
    assert _choices(EffectsOption) == {"on", "off"} | set(EFFECTS)
    assert _choices(OdometryOption) == set(ODOMETRIES)


def _choices(option: object) -> set[str]:
    literal, *_ = get_args(option)
    return set(get_args(literal))


@pytest.mark.slow
def test_an_export_is_a_log_that_runs_to_the_same_trajectory(cwlf: Call, tmp_path: Path) -> None:
    """Stamps are of microseconds and poses of nanometres in a CARMEN log; 10 um leave room for both."""
    recording, log = tmp_path / "b.gz", tmp_path / "b.log"
    path = tmp_path / "path.csv"
    path.write_text("1.8,2.8\n1.2,3.6\n1.2,4.6\n")
    sensor = ("--sensor", "sick-lms")
    assert cwlf("simulate", "--world", "environment-b", "--path", path, "--out", recording, *sensor)[0] == 0
    assert cwlf("export", recording, "--format", "carmen", "--out", log)[0] == 0
    assert isinstance(next(iter(CarmenLog(log))), Frame)
    for name, source in (("recorded", recording), ("exported", log)):
        assert cwlf("run", source, "--out", tmp_path / name)[0] == 0
    one, other = (np.loadtxt(tmp_path / name / "trajectory.tum") for name in ("recorded", "exported"))
    np.testing.assert_allclose(one, other, atol=1e-5)
    code, _, err = cwlf("export", recording, "--out", log)
    assert (code, len(err.splitlines())) == (1, 1)
    assert "--overwrite" in err


def test_ctrl_c_leaves_a_recording_of_what_was_done(
    cwlf: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = SimulatedRun.__iter__

    def interrupted(run: SimulatedRun) -> Iterator[Frame]:
        for number, frame in enumerate(frames(run)):
            if number == 120:
                signal.raise_signal(signal.SIGINT)
            yield frame

    monkeypatch.setattr(SimulatedRun, "__iter__", interrupted)
    recording = tmp_path / "b.gz"
    code, _, err = cwlf("simulate", "--world", "environment-b", "--out", recording)
    assert code == 130
    assert "interrupted" in err
    assert len(list(Recording(recording))) == 121


def test_a_recording_that_is_there_is_kept(cwlf: Call, tmp_path: Path) -> None:
    recording = tmp_path / "b.gz"
    recording.write_text("precious")
    code, _, err = cwlf("simulate", "--world", "environment-b", "--out", recording)
    assert (code, len(err.splitlines())) == (1, 1)
    assert recording.read_text() == "precious"


BAD_WORLDS: dict[str, tuple[str, str]] = {
    "unclosed": ('[{"points": [[0, 0], [5, 0], [5, 5], [0, 5]]}]', "an outline of 3 walls is not closed"),
    "nan": ('[{"points": [[0, 0], [NaN, 0]]}]', "finite number"),
    "no length": ('[{"points": [[0, 0], [5, 0], [5, 0], [0, 5]], "closed": true}]', "wall 1 has no length"),
    "in a wall": ('[{"points": [[0.9, 0], [5, 0], [5, 5], [0.9, 5]], "closed": true}]', r"starts at (1, 1), in wall 3"),
    "through a wall": (
        '[{"points": [[0, 0], [5, 0], [5, 5], [0, 5]], "closed": true}, {"points": [[2, 0], [2, 5]]}]',
        "goes through wall 4 from (2, 0) to (2, 5)",
    ),
    "outside": ('[{"points": [[0, 0], [2, 0], [2, 2], [0, 2]], "closed": true}]', "waypoint 1 at (4, 1) is outside"),
    "no JSON": ("[", "JSON"),
}


@pytest.mark.parametrize("kind", BAD_WORLDS)
def test_a_bad_world_is_one_line_and_leaves_no_recording(kind: str, cwlf: Call, tmp_path: Path) -> None:
    walls, cause = BAD_WORLDS[kind]
    world = tmp_path / "bad.json"
    world.write_text(f'{{"format": "cwlf-world", "version": 1, "waypoints": [[1, 1], [4, 1]], "walls": {walls}}}')
    code, out, err = cwlf("simulate", "--world", world, "--out", tmp_path / "r.gz")
    assert (code, out) == (1, "")
    assert len(err.splitlines()) == 1
    assert cause in err
    assert "bad" in err
    assert not (tmp_path / "r.gz").exists()


def test_an_open_world_is_driven_when_told_to(cwlf: Call, tmp_path: Path) -> None:
    world = world_file(tmp_path / "wall.json", [[0, 0], [4, 0], [4, 4]], waypoints=[[1, 1], [2, 1]])
    assert cwlf("simulate", "--world", world, "--out", tmp_path / "r.gz")[0] == 1
    assert cwlf("simulate", "--world", world, "--out", tmp_path / "r.gz", "--open")[0] == 0
    assert len(Recording(tmp_path / "r.gz").walls) == 2


def test_what_is_missing_is_one_line(cwlf: Call, tmp_path: Path) -> None:
    pathless = world_file(tmp_path / "pathless.json", SQUARE)
    arguments: list[tuple[str, ...]] = [
        ("world", "show", "palace"),
        ("world", "check", str(tmp_path)),
        ("simulate", "--world", str(pathless), "--out", str(tmp_path / "r")),
        ("simulate", "--world", "room", "--path", str(tmp_path / "p.csv"), "--out", str(tmp_path / "r")),
        ("simulate", "--world", "room", "--sensor", "s9", "--out", str(tmp_path / "r")),
        ("export", str(tmp_path / "none.gz"), "--out", str(tmp_path / "e.log")),
        ("world", "show", "room", "--out", str(pathless / "room.png")),
    ]
    for command in arguments:
        code, out, err = cwlf(*command)
        assert (code, out, len(err.splitlines())) == (1, "", 1), command
    assert cwlf("simulate", "--world", "room")[0] == 2
    assert cwlf("export", "r", "--out", "x", "--format", "bag")[0] == 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["map", "plan", "house"])
def test_worlds_from_files_are_driven_through_and_mapped(
    kind: str, cwlf: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ROS map, a DXF plan and a Gazebo house, the first minute: ATE and corners at a few centimetres."""
    import runpy

    path = tmp_path / "path.csv"
    if kind == "house":
        world = DATA / "turtlebot3-house.sdf"
        if not world.is_file():
            pytest.skip(f"{world} is absent: set CWLF_DATA to the folder of the test data")
        lines = (EXAMPLES / "turtlebot3-house.csv").read_text().splitlines(keepends=True)
        path.write_text("".join(lines[: 2 + 14]))
    else:
        monkeypatch.setattr(sys, "argv", ["draw_floor_plans.py", str(tmp_path)])
        runpy.run_path(str(EXAMPLES / "draw_floor_plans.py"), run_name="__main__")
        world = tmp_path / {"map": "apartment-map.yaml", "plan": "apartment-plan.dxf"}[kind]
        np.savetxt(path, np.array(find_site("apartment").waypoints)[:17], delimiter=",")
    recording, run = tmp_path / "r.gz", tmp_path / "run"
    assert cwlf("simulate", "--world", world, "--path", path, "--out", recording)[0] == 0
    assert cwlf("run", recording, "--out", run, "--limit", 600)[0] == 0
    report = json.loads(cwlf("evaluate", run, "--truth", recording, "--json")[1])
    assert report["ate"]["rmse_m"] < 0.05
    assert report["landmarks"]["corners_mapped"] >= 11
    assert report["landmarks"]["rmse_m"] < 0.1
