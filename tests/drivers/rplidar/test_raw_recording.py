from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from emulated import emulated_chunks

from drivers.errors import LogFormatError
from drivers.frame import Frame, SourceInfo
from drivers.recording.recorder import Recorder
from drivers.recording.recording import Recording
from drivers.rplidar import RawRecorder, RawRecording, RevolutionDecoder
from features.scan import LaserScan

EPOCH = 1.7e9


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of an emulated scanner as the driver makes it: the frames behind the bytes that they are made of."""
    path = tmp_path_factory.mktemp("raw") / "hall.jsonl.gz"
    stream, chunks = emulated_chunks(seconds=3.0)
    with Recorder(path, SourceInfo("S1M1", "rplidar-s1", has_odometry=False)) as recorder:
        tap = RawRecorder(recorder)
        tap.begin(stream, EPOCH)
        decoder = RevolutionDecoder(stream)
        for time, data in chunks:
            tap.chunk(data, EPOCH + time)
            for scan in decoder.feed(data, EPOCH + time):
                recorder.write(Frame(scan.stamp, np.zeros(3), scan))
    return path


def same(frames: list[Frame], others: list[Frame]) -> bool:
    return len(frames) == len(others) and all(
        a.stamp == b.stamp
        and a.scan is not None
        and b.scan is not None
        and np.array_equal(a.scan.angles, b.scan.angles)
        and a.scan.times is not None
        and b.scan.times is not None
        and np.array_equal(a.scan.times, b.scan.times)
        and np.array_equal(np.round(a.scan.ranges, 6), np.round(b.scan.ranges, 6))
        for a, b in zip(frames, others, strict=True)
    )


def test_bytes_decoded_again_are_the_frames_that_were_recorded(recording: Path):
    frames = list(Recording(recording))
    assert len(frames) >= 15
    assert same(frames, list(RawRecording(recording)))


def test_frames_come_anew_with_each_iteration_and_are_counted(recording: Path):
    raw = RawRecording(recording)
    frames = list(raw)
    assert raw.counts.revolutions == len(frames)
    assert raw.counts.dropped_bytes == 0
    assert same(frames, list(raw))
    assert raw.counts.revolutions == len(frames)


def test_what_a_killed_process_leaves_lacks_no_more_than_a_second(tmp_path: Path):
    path = tmp_path / "killed.jsonl.gz"
    stream, chunks = emulated_chunks(seconds=3.0)
    recorder = Recorder(path, SourceInfo("S1M1", "rplidar-s1", has_odometry=False))
    tap = RawRecorder(recorder)
    tap.begin(stream, EPOCH)
    decoder = RevolutionDecoder(stream)
    for time, data in chunks:
        tap.chunk(data, EPOCH + time)
        for scan in decoder.feed(data, EPOCH + time):
            recorder.write(Frame(scan.stamp, np.zeros(3), scan))
    last = scan.stamp
    killed = tmp_path / "copy.jsonl.gz"
    killed.write_bytes(path.read_bytes())  # the recorder is not closed: what it has not flushed is not there
    recorder.close()
    frames = list(Recording(killed))
    assert last - 1.0 - 0.2 <= frames[-1].stamp < last  # the last revolution before the flush was not complete
    assert list(RawRecording(killed))[-1].stamp >= last - 1.2


def test_odometry_of_the_frames_is_interpolated(tmp_path: Path):
    path = tmp_path / "wheels.jsonl.gz"
    stream, chunks = emulated_chunks(seconds=2.0)
    with Recorder(path, SourceInfo("S1M1", "rplidar-s1")) as recorder:
        tap = RawRecorder(recorder)
        tap.begin(stream, 0.0)
        for time, data in chunks:
            tap.chunk(data, time)
        for stamp in (0.0, 2.0):
            pose = np.array([10.0 * stamp, 1.0, 3.0 + 0.2 * stamp])
            recorder.write(Frame(stamp, pose, LaserScan(np.ones(1), np.zeros(1), stamp)))
    frames = list(RawRecording(path))
    assert len(frames) >= 5
    for frame in frames:
        expected = [10.0 * frame.stamp, 1.0, 3.0 + 0.2 * frame.stamp]
        assert frame.pose_odom_robot == pytest.approx(expected, abs=1e-9)


def test_recording_without_bytes_is_refused(tmp_path: Path):
    path = tmp_path / "scans.jsonl.gz"
    with Recorder(path, SourceInfo("hall", "rplidar-s1")) as recorder:
        recorder.write(Frame(0.0, np.zeros(3)))
    with pytest.raises(LogFormatError, match=r"scans\.jsonl\.gz holds no raw bytes"):
        RawRecording(path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('{"bytes":"!","time":1.0}', "line 3: "),
        ('{"bytes":"AAAA"}', "line 3: no key 'time'"),
        ('{"stream":{"answer":1,"us_per_sample":1.0,"baud":1},"time":0.0}', "line 3: "),
    ],
)
def test_damaged_line_is_named(tmp_path: Path, line: str, message: str):
    path = tmp_path / "damaged.jsonl"
    header = '{"format":"cwlf-recording","version":1,"name":"a","sensor":"rplidar-s1","odometry":false}'
    stream = '{"stream":{"answer":133,"us_per_sample":108.0,"baud":256000},"time":0.0}'
    path.write_text("\n".join([header, stream, line, ""]))
    with pytest.raises(LogFormatError, match=message):
        list(RawRecording(path))


def test_frames_rise_in_time(recording: Path):
    stamps = [frame.stamp for frame in RawRecording(recording)]
    assert all(a < b for a, b in pairwise(stamps))
