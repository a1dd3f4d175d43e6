"""Recordings: what is written is read, what a killed process leaves is readable, what is wrong is named."""

import gzip
import json
import logging
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import CarmenLog, Frame, LogFormatError, Recorder, RecordError, Recording, is_recording, open_log
from drivers.frame import SourceInfo
from features.scan import LaserScan
from features.sensor import Mounting

MOUNTING = Mounting(0.1, -0.05, 0.3, upside_down=True)
HEADER = {"format": "cwlf-recording", "version": 1, "name": "hall", "sensor": "sick-lms"}
SCAN = {"stamp": 0.0, "odom": [0, 0, 0], "scan": {"ranges": [1, None], "beams": {"angles": [0.0, 0.5]}}}

finite = st.floats(-1e6, 1e6)
poses = st.tuples(finite, finite, st.floats(-4.0, 4.0)).map(np.array)


@st.composite
def drives(draw):
    """Frames with and without scans, of beams and times that change, each with or without its true pose."""
    beams = draw(st.lists(st.tuples(st.integers(1, 5), st.booleans()), min_size=1, max_size=3))
    sets = [
        (np.array(draw(st.lists(finite, min_size=n, max_size=n))), np.linspace(0.0, 0.1, n) if timed else None)
        for n, timed in beams
    ]
    frames = []
    for stamp in sorted(draw(st.lists(st.floats(0.0, 1e9), min_size=1, max_size=8))):
        scan = None
        if not frames or draw(st.booleans()):
            angles, times = draw(st.sampled_from(sets))
            ranges = draw(st.lists(st.floats(0.0, 1e3) | st.just(np.inf), min_size=len(angles), max_size=len(angles)))
            scan = LaserScan(np.array(ranges), angles, draw(st.sampled_from([stamp, stamp + 0.01])), times)
        frames.append((Frame(stamp, draw(poses), scan), draw(st.none() | poses)))
    return frames


def record(path, frames, *, odometry=True, **more):
    info = SourceInfo("hall", "rplidar-s1", MOUNTING, odometry)
    with Recorder(path, info, overwrite=True, **more) as recorder:
        for frame, truth in frames:
            recorder.write(frame, truth)
    return path


def assert_same(read, frame):
    assert read.stamp == frame.stamp
    np.testing.assert_array_equal(read.pose_odom_robot, frame.pose_odom_robot)
    assert (read.scan is None) == (frame.scan is None)
    if read.scan is not None and frame.scan is not None:
        assert read.scan.stamp == frame.scan.stamp
        np.testing.assert_array_equal(read.scan.angles, frame.scan.angles)
        # Half a micrometre, and the rounding of a number of a thousand metres.
        np.testing.assert_allclose(read.scan.ranges, frame.scan.ranges, rtol=1e-12, atol=0.5001e-6)
        assert (read.scan.times is None) == (frame.scan.times is None)
        if frame.scan.times is not None:
            np.testing.assert_array_equal(read.scan.times, frame.scan.times)


@pytest.mark.parametrize("odometry", [True, False])
def test_a_recording_tells_whether_its_poses_are_odometry(tmp_path, odometry):
    path = record(
        tmp_path / "r", [(Frame(0.0, np.zeros(3), LaserScan(np.ones(2), np.arange(2.0))), None)], odometry=odometry
    )
    assert Recording(path).has_odometry is odometry


@pytest.mark.slow
@settings(derandomize=True, deadline=None)
@given(drawn=drives())
def test_what_is_written_is_read(drawn, tmp_path_factory):
    """All but the ranges to the last bit; twice from the same object."""
    path = record(tmp_path_factory.mktemp("recording") / "drive.gz", drawn)
    recording = Recording(path)
    for _ in range(2):
        read = list(recording)
        assert len(read) == len(drawn)
        for got, (frame, _) in zip(read, drawn, strict=True):
            assert_same(got, frame)
    assert (recording.name, recording.sensor, recording.mounting) == ("hall", "rplidar-s1", MOUNTING)
    known = [(frame.stamp, truth) for frame, truth in drawn if truth is not None]
    if known:
        stamps, truth = recording.truth()
        np.testing.assert_array_equal(stamps, [stamp for stamp, _ in known])
        np.testing.assert_array_equal(truth, [pose for _, pose in known])
    else:
        with pytest.raises(LogFormatError, match="no true poses"):
            recording.truth()


@pytest.fixture
def drive():
    rng = np.random.default_rng(3)
    angles = np.linspace(-1.5, 1.5, 40)
    return [
        (Frame(0.1 * k, rng.normal(size=3), LaserScan(rng.uniform(1.0, 9.0, 40), angles)), rng.normal(size=3))
        for k in range(200)
    ]


def test_walls_and_glass_are_kept(drive, tmp_path):
    walls = np.random.default_rng(4).normal(size=(7, 4))
    glass = np.arange(7) % 3 == 0
    recording = Recording(record(tmp_path / "r.gz", drive[:2], walls=walls, glass=glass))
    np.testing.assert_array_equal(recording.walls, walls)
    np.testing.assert_array_equal(recording.glass, glass)
    assert len(list(recording)) == 2
    assert Recording(record(tmp_path / "n.gz", drive[:2])).walls.shape == (0, 4)


def test_the_same_frames_give_the_same_bytes(drive, tmp_path):
    one, other = record(tmp_path / "one.gz", drive), record(tmp_path / "other.name", drive)
    assert one.read_bytes() == other.read_bytes()


def test_it_is_json_lines_in_gzip(drive, tmp_path):
    """Read without the project, as docs/worlds.md says: the beams stand once, ranges and poses in every scan."""
    with gzip.open(record(tmp_path / "r.jsonl.gz", drive), "rt") as lines:
        header, *records = [json.loads(line) for line in lines]
    assert header["format"] == "cwlf-recording"
    assert len(records) == 200
    assert [k for k, line in enumerate(records) if "beams" in line["scan"]] == [0]
    np.testing.assert_allclose(records[7]["scan"]["ranges"], drive[7][0].scan.ranges, atol=0.51e-6)
    np.testing.assert_array_equal(records[7]["truth"], drive[7][1])


def test_an_unzipped_recording_is_read(drive, tmp_path):
    plain = tmp_path / "r.jsonl"
    plain.write_bytes(gzip.decompress(record(tmp_path / "r.gz", drive).read_bytes()))
    assert len(list(Recording(plain))) == 200


def test_logs_are_told_apart_by_content(drive, tmp_path):
    recorded = record(tmp_path / "my.log", drive)
    carmen = tmp_path / "r.jsonl.gz"
    carmen.write_bytes(gzip.compress(b"FLASER 2 1 1 0 0 0 0 0 0 1.0 host 1.0\n"))
    assert isinstance(open_log(recorded), Recording)
    assert isinstance(open_log(carmen), CarmenLog)
    assert not is_recording(tmp_path / "missing")
    with pytest.raises(LogFormatError, match="no such file"):
        open_log(tmp_path / "missing")


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_cut_file_is_read_up_to_the_cut(share, drive, tmp_path, caplog):
    path = record(tmp_path / "r.gz", drive)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with caplog.at_level(logging.WARNING):
        read = list(Recording(path))
    assert len(read) > 200 * share - 10
    for got, (frame, _) in zip(read, drive, strict=False):
        assert_same(got, frame)
    assert "gzip data end early" in caplog.text


@pytest.mark.slow
def test_a_killed_recorder_leaves_all_but_its_last_frames(tmp_path):
    """The process ends without closing anything, as by kill -9, after 170 frames; 150 of them were flushed."""
    path = tmp_path / "killed.gz"
    code = (
        "import os, sys, numpy as np\n"
        "from drivers import Frame, Recorder, SourceInfo\n"
        "from features.scan import LaserScan\n"
        "recorder = Recorder(sys.argv[1], SourceInfo('k', 'sick-lms'))\n"
        "for k in range(170):\n"
        "    recorder.write(Frame(0.1 * k, np.zeros(3), LaserScan(np.ones(3), np.arange(3.0))))\n"
        "os._exit(9)\n"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == 9
    assert 150 <= len(list(Recording(path))) <= 170


@pytest.mark.slow
def test_memory_does_not_grow_with_the_recording(tmp_path):
    rng, angles = np.random.default_rng(5), np.linspace(0.0, 1.0, 100)

    def peak(count):
        tracemalloc.start()
        with Recorder(tmp_path / f"{count}.gz", SourceInfo("m", "sick-lms")) as recorder:
            for k in range(count):
                recorder.write(Frame(float(k), np.zeros(3), LaserScan(rng.uniform(1.0, 9.0, 100), angles)))
        for _ in Recording(tmp_path / f"{count}.gz"):
            pass
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    peak(10)
    assert peak(3000) < 1.5 * peak(300)


def test_a_file_that_is_there_is_kept_unless_told_otherwise(tmp_path):
    path = tmp_path / "mine.gz"
    path.write_text("precious")
    with pytest.raises(RecordError, match="is there already"):
        Recorder(path, SourceInfo("n", "sick-lms"))
    assert path.read_text() == "precious"


def test_a_place_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path / "file" / "r.gz", tmp_path):
        with pytest.raises(RecordError, match=r"cannot be written|there already"):
            Recorder(path, SourceInfo("n", "sick-lms"))


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "is empty"),
        ([{}, SCAN], "line 1: "),
        ([HEADER | {"version": 2}, SCAN], "line 1: version: Input should be 1"),
        ([HEADER | {"nmae": "x"}, SCAN], "line 1: nmae"),
        ([HEADER], "has no scan"),
        ([HEADER, {"stamp": 0, "odom": [0, 0, 0]}], "has no scan"),
        ([HEADER, {"wall": [0, 0, 1]}, SCAN], "a wall is not of four numbers"),
        ([HEADER, {"odom": [0, 0, 0]}, SCAN], "line 2: no key 'stamp'"),
        ([HEADER, SCAN | {"odom": [0, 0]}, SCAN], "line 2: a pose of 2 numbers"),
        ([HEADER, SCAN | {"odom": [0, 0, "1"]}, SCAN], "line 2: .* expected a list of numbers"),
        ([HEADER, SCAN | {"odom": [0, 0, None]}, SCAN], "line 2: .* expected a list of numbers"),
        ([HEADER, SCAN | {"truth": [0, 0, True]}, SCAN], "line 2: .* expected a list of numbers"),
        ([HEADER, SCAN | {"stamp": float("nan")}, SCAN], "line 2: NaN: expected a finite number"),
        ([HEADER, SCAN | {"scan": {"ranges": [1, 2]}}, SCAN], "line 2: the first scan has no beams"),
        ([HEADER, SCAN, SCAN | {"scan": {"ranges": [1, 2, 3]}}, SCAN], "line 3: a scan needs one angle per range"),
        ([HEADER, SCAN, SCAN | {"scan": {"ranges": [1, -2]}}, SCAN], "line 3: range of beam 1 is -2"),
        ([HEADER, SCAN, SCAN | {"scan": {"ranges": 5}}, SCAN], "line 3: 5: expected a list of numbers"),
        ([HEADER, SCAN, SCAN | {"scan": 5}, SCAN], "line 3: "),
        ([HEADER, SCAN, [1, 2], SCAN], "line 3: list: expected an object"),
        ([HEADER, SCAN, SCAN | {"stamp": -1.0}], "line 3: stamp goes back by 1.0"),
    ],
)
def test_what_is_wrong_is_named_by_its_line(lines, message, tmp_path):
    path = tmp_path / "bad.jsonl"
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    with pytest.raises(LogFormatError, match=message) as caught:
        list(Recording(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_frames_before_a_broken_line_are_yielded(tmp_path):
    path = tmp_path / "bad.jsonl"
    path.write_text("\n".join([json.dumps(HEADER), json.dumps(SCAN), "{broken", json.dumps(SCAN)]) + "\n")
    frames = iter(Recording(path))
    assert next(frames).stamp == 0.0
    with pytest.raises(LogFormatError, match="line 3"):
        next(frames)
