import gzip
import logging
import math
import random
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import drivers.reorder
from drivers.carmen.log import CarmenLog
from drivers.errors import LogFormatError
from drivers.frame import FrameSource
from drivers.log_lines import GZIP_CHUNK_BYTES, LINE_BYTES
from drivers.reorder import REORDER_WINDOW, ReorderWindow
from features.errors import CwlfError
from features.se2 import wrap_angle
from features.sensor import Mounting, sensor_preset


def flaser(stamp=1.0, ranges=(1.0, 2.0, 3.0), pose=(0.1, 0.2, 0.3), laser=(0.0, 0.0, 0.0), logger_stamp=0.5):
    numbers = " ".join(map(repr, [*ranges, *laser, *pose, stamp]))
    return f"FLASER {len(ranges)} {numbers} nohost {logger_stamp}"


def robotlaser(
    stamp=1.0, ranges=(1.0, 2.0, 3.0), pose=(0.1, 0.2, 0.3), start=-0.5, step=0.25, range_limit=30.0, remissions=()
):
    head = f"ROBOTLASER1 0 {start!r} 3.14 {step!r} {range_limit!r} 0.01 1"
    beams = " ".join(map(str, [len(ranges), *map(repr, ranges), len(remissions), *remissions]))
    poses = " ".join(map(repr, [9.0, 9.0, 1.0, *pose]))
    return f"{head} {beams} {poses} 0.5 0.1 0.2 0.2 1e6 {stamp!r} nohost 0.5"


def odom(stamp=1.0, pose=(0.1, 0.2, 0.3)):
    return f"ODOM {' '.join(map(repr, pose))} 0.5 0.1 0 {stamp!r} nohost 0.5"


def replace_field(line, index, text):
    fields = line.split()
    fields[index] = text
    return " ".join(fields)


def only_scan(path):
    (frame,) = CarmenLog(path)
    assert frame.scan is not None
    return frame.scan


def same(first, second):
    def scan(frame):
        return None if frame.scan is None else (frame.scan.ranges.tolist(), frame.scan.angles.tolist())

    return [(f.stamp, f.pose_odom_robot.tolist(), scan(f)) for f in first] == [
        (f.stamp, f.pose_odom_robot.tolist(), scan(f)) for f in second
    ]


def test_flaser_gives_ranges_odometry_and_ipc_stamp(write_log):
    line = flaser(976052857.33753, (1.0, 0.0, 81.83), (0.1, -0.2, 0.3), laser=(7.0, 8.0, 0.9))
    (frame,) = CarmenLog(write_log(line))
    scan = only_scan(write_log(line))
    assert frame.stamp == scan.stamp == 976052857.33753
    assert frame.pose_odom_robot == pytest.approx([0.1, -0.2, 0.3])
    assert scan.ranges.tolist() == [1.0, 0.0, 81.83]


@pytest.mark.parametrize(
    ("count", "first_deg", "step_deg"),
    [(180, -90, 1), (360, -90, 0.5), (181, -90, 1), (361, -90, 0.5), (4, -90, 45), (5, -90, 45), (720, -90, 0.25)],
)
def test_flaser_angles_include_the_last_only_for_odd_counts(write_log, count, first_deg, step_deg):
    scan = only_scan(write_log(flaser(ranges=[1.0] * count)))
    assert np.rad2deg(scan.angles) == pytest.approx(first_deg + step_deg * np.arange(count), abs=1e-12)


def test_scans_do_not_share_their_arrays(write_log):
    first, second = (only_scan(write_log(flaser(stamp))) for stamp in (1.0, 2.0))
    assert not np.shares_memory(first.angles, second.angles)


def test_robotlaser_gives_its_own_angles_and_the_robot_pose(write_log):
    line = robotlaser(5.0, (1.0, 29.9, 30.0, 31.0), (0.1, 0.2, 0.3), start=-0.5, step=0.25, remissions=(7, 8))
    (frame,) = CarmenLog(write_log(line))
    scan = only_scan(write_log(line))
    assert scan.angles == pytest.approx([-0.5, -0.25, 0.0, 0.25])
    assert scan.ranges.tolist() == [1.0, 29.9, math.inf, math.inf]
    assert frame.pose_odom_robot == pytest.approx([0.1, 0.2, 0.3])
    assert frame.stamp == 5.0


def test_odom_is_a_frame_without_scan(write_log):
    frames = list(CarmenLog(write_log(odom(1.0, (1.0, 2.0, 7.0)), flaser(2.0))))
    assert frames[0].scan is None
    assert frames[0].pose_odom_robot == pytest.approx([1.0, 2.0, 7.0 - 2 * math.pi])


def test_infinite_range_is_no_return(write_log):
    scan = only_scan(write_log(replace_field(flaser(), 3, "inf")))
    assert scan.ranges.tolist() == [1.0, math.inf, 3.0]


def test_comments_blank_lines_and_other_messages_are_skipped(write_log):
    path = write_log("# é", "", flaser(), "  ", "RLASER 3 1 2", "SYNC x", "PARAM other", "PARAM", "#", flaser(2.0), "")
    assert [frame.stamp for frame in CarmenLog(path)] == [1.0, 2.0]


def test_carriage_returns_are_no_part_of_a_line(write_log):
    assert len(list(CarmenLog(write_log(flaser() + "\r", odom() + "\r")))) == 2


def test_mounting_is_known_before_the_first_frame(write_log):
    log = CarmenLog(
        write_log(
            "PARAM robot_frontlaser_offset 0.25 nohost 0",
            "PARAM robot_frontlaser_side_offset -0.1 nohost 0",
            "PARAM robot_frontlaser_angular_offset 0.02 nohost 0",
            "PARAM robot_rearlaser_offset 9 nohost 0",
            flaser(),
        )
    )
    assert log.mounting == Mounting(0.25, -0.1, 0.02)


def test_mounting_after_the_first_record_is_ignored_with_a_warning(write_log, caplog):
    log = CarmenLog(write_log(flaser(), "PARAM robot_frontlaser_offset 0.25 nohost 0", odom()))
    assert len(list(log)) == 2
    assert log.mounting == Mounting()
    assert "line 2" in caplog.text


@pytest.mark.parametrize(
    ("file_name", "name"),
    [("a.clf", "a"), ("a.log.gz", "a"), ("a.CLF.GZ", "a"), ("a.b.log", "a.b"), ("run", "run"), (".clf", ".clf")],
)
def test_name_is_the_file_name_without_its_endings(write_log, file_name, name):
    log: FrameSource = CarmenLog(write_log(flaser(), name=file_name))
    assert log.name == name
    assert sensor_preset(log.sensor).range_max == 80.0


@pytest.mark.parametrize("name", ["run.clf", "run.log.gz", "run"])
def test_gzip_is_recognised_by_its_bytes(write_log, name):
    plain = list(CarmenLog(write_log(flaser(), odom(2.0), name="plain.gz")))
    packed = list(CarmenLog(write_log(flaser(), odom(2.0), name=name, compress=True)))
    assert len(packed) == 2
    assert same(plain, packed)


def test_gzip_members_in_a_row_and_padding_are_one_log(tmp_path):
    path = tmp_path / "run.clf.gz"
    members = [gzip.compress((flaser(float(i)) + "\n").encode()) for i in range(3)]
    path.write_bytes(members[0] + members[1] + b"\0" * 20 + members[2] + b"\0" * 20)
    assert [frame.stamp for frame in CarmenLog(path)] == [0.0, 1.0, 2.0]


def test_frames_come_in_order_of_their_stamps(write_log):
    stamps = np.random.default_rng(1).permutation(59).astype(float).tolist()
    frames = list(CarmenLog(write_log(*map(flaser, stamps))))
    assert [frame.stamp for frame in frames] == sorted(stamps)


def test_equal_stamps_keep_the_order_of_the_file(write_log):
    lines = [flaser(5.0, pose=(float(i), 0.0, 0.0)) for i in range(20)]
    frames = list(CarmenLog(write_log(odom(6.0), *lines)))
    assert [frame.pose_odom_robot[0] for frame in frames[:-1]] == list(range(20))


def test_a_stamp_that_goes_back_beyond_the_window_is_an_error_after_the_frames_before_it(write_log):
    log = iter(CarmenLog(write_log(flaser(0.0), flaser(100.0), flaser(200.0), flaser(5.0))))
    assert [next(log).stamp for _ in range(3)] == [0.0, 100.0, 200.0]
    with pytest.raises(LogFormatError, match=r"run\.clf, line 4: stamp goes back by 195\.000 s from that of line 3"):
        next(log)


def test_frames_are_held_back_only_within_the_window(write_log):
    """A stream of any length needs memory for one window only."""
    frames = iter(CarmenLog(write_log(*(odom(float(i)) for i in range(200)), "FLASER x")))
    assert [next(frames).stamp for _ in range(200)] == list(range(200))
    window = ReorderWindow()
    held = 0
    for i, frame in enumerate(CarmenLog(write_log(*(flaser(float(i)) for i in range(200))))):
        held += 1 - len(list(window.push(frame, i)))
        assert held <= REORDER_WINDOW + 1


def test_a_clock_that_stands_still_does_not_fill_the_memory(write_log, monkeypatch):
    monkeypatch.setattr(drivers.reorder, "REORDER_RECORDS", 10)
    window = ReorderWindow()
    frames = list(CarmenLog(write_log(*[flaser(1.0)] * 50)))
    assert len(frames) == 50
    assert sum(len(list(window.push(frame, i))) for i, frame in enumerate(frames)) == 40


def test_a_second_iteration_is_identical(write_log):
    log = CarmenLog(write_log(flaser(2.0), odom(1.0), robotlaser(3.0), compress=True))
    assert same(list(log), list(log))
    unfinished = iter(log)
    next(unfinished)
    assert len(list(log)) == 3


def test_progress_never_falls_and_ends_at_one(write_log):
    log = CarmenLog(write_log(*(flaser(float(i), ranges=[1.0] * 180) for i in range(300))))
    progress = [log.progress, *(log.progress for _ in log), log.progress]
    assert 0.0 <= progress[0] < 0.5
    assert progress == sorted(progress)
    assert len(set(progress)) > 2
    assert progress[-1] == 1.0


GOOD = flaser()


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        (GOOD + " 1.0", "FLASER of 3 ranges with 15 fields: expected 14"),
        (GOOD.rsplit(" ", 1)[0], "FLASER of 3 ranges with 13 fields: expected 14"),
        (replace_field(GOOD, 1, "2"), "of 2 ranges with 14 fields: expected 13"),
        (replace_field(GOOD, 1, "-3"), "number of ranges is '-3': expected a whole number"),
        (replace_field(GOOD, 1, "0"), "expected a whole number of at least 1"),
        (replace_field(GOOD, 1, "9" * 5000), "expected a whole number"),
        ("FLASER", "expected the number of ranges"),
        (replace_field(GOOD, 2, "1.0.0"), "'1.0.0' in the ranges is no number"),
        (replace_field(GOOD, 2, "1_0"), "'1_0' in the ranges is no number"),
        (replace_field(GOOD, 2, "nan"), "range of beam 0 is nan"),
        (replace_field(GOOD, 3, "-1"), "range of beam 1 is -1"),
        (replace_field(GOOD, 8, "inf"), "inf in the odometry pose: expected a finite number"),
        (replace_field(GOOD, 5, "nan"), "nan in the laser pose"),
        (replace_field(GOOD, 11, "nan"), "nan in the ipc stamp"),
        (replace_field(GOOD, 13, "x"), "'x' in the logger stamp is no number"),
        (replace_field(odom(), 1, "a"), "'a' in the odometry pose is no number"),
        (replace_field(odom(), 7, "inf"), "inf in the ipc stamp"),
        (odom() + " 1", "ODOM with 11 fields: expected 10"),
        (robotlaser() + " 1", "ROBOTLASER1 of 3 ranges and 0 remissions with 28 fields: expected 27"),
        (replace_field(robotlaser(), 12, "z"), "number of remissions is 'z'"),
        (replace_field(robotlaser(), 2, "inf"), "inf in the beam angles"),
        (replace_field(robotlaser(), 5, "nan"), "maximum range is nan"),
        (replace_field(robotlaser(), 10, "-2"), "range of beam 1 is -2"),
        (replace_field(robotlaser(), 16, "nan"), "nan in the robot pose"),
        ("FLASER \0", "binary data: expected the text of a CARMEN log"),
        (b"# \xff", "binary data"),
    ],
)
def test_an_unusable_line_is_an_error_that_names_it(write_log, line, cause):
    frames = iter(CarmenLog(write_log("# head", GOOD, line, GOOD)))
    next(frames)
    with pytest.raises(LogFormatError) as error:
        next(frames)
    assert "run.clf, line 3: " in str(error.value)
    assert cause in str(error.value)
    assert "\n" not in str(error.value)


def test_errors_before_the_first_record_are_raised_at_once(write_log):
    with pytest.raises(LogFormatError, match=r"line 1: 'x' in the PARAM robot_frontlaser_offset is no number"):
        CarmenLog(write_log("PARAM robot_frontlaser_offset x", flaser()))
    with pytest.raises(LogFormatError, match="line 1: binary data"):
        CarmenLog(write_log(b"\x89PNG", b"\0", flaser()))
    with pytest.raises(LogFormatError, match="line 1: binary data"):
        CarmenLog(write_log(b"\0" * 100, end=b""))
    with pytest.raises(LogFormatError, match="line 1: longer than"):
        CarmenLog(write_log(b"x" * (LINE_BYTES + 1), end=b""))


def test_files_that_cannot_be_opened_are_errors(tmp_path):
    with pytest.raises(LogFormatError, match=r"absent\.clf: no such file: expected a CARMEN log"):
        CarmenLog(tmp_path / "absent.clf")
    with pytest.raises(LogFormatError, match="is a directory"):
        CarmenLog(str(tmp_path))
    with pytest.raises(LogFormatError, match="cannot be read"):
        CarmenLog(tmp_path / ("x" * 5000))


@pytest.mark.parametrize("content", [b"", b"\n \n", gzip.compress(b"", mtime=0)])
def test_a_log_without_text_is_empty(tmp_path, content):
    (tmp_path / "run.clf").write_bytes(content)
    with pytest.raises(LogFormatError, match=r"run\.clf is empty"):
        CarmenLog(tmp_path / "run.clf")


def test_a_log_without_scans_is_an_error_at_its_end(write_log):
    frames = iter(CarmenLog(write_log(odom(1.0), odom(2.0))))
    assert [next(frames).stamp, next(frames).stamp] == [1.0, 2.0]
    with pytest.raises(LogFormatError, match="has no scan: expected FLASER or ROBOTLASER1"):
        next(frames)
    log = CarmenLog(write_log("some text", "# only"))
    with pytest.raises(LogFormatError, match="has no scan"):
        list(log)


@pytest.mark.parametrize("line", [flaser(2.0), robotlaser(2.0, remissions=(1, 2)), odom(2.0)])
def test_a_last_line_cut_anywhere_costs_only_itself(write_log, caplog, line):
    for length in range(1, len(line)):
        caplog.clear()
        frames = list(CarmenLog(write_log(flaser(1.0), line[:length], end=b"")))
        assert frames[0].stamp == 1.0
        if length < len(line) - len(" 0.5"):
            assert len(frames) == 1
            assert "run.clf, line 2: skipped" in caplog.text
        else:
            assert len(frames) + len(caplog.records) == 2


def test_a_short_last_line_costs_only_itself_even_if_blank_lines_follow(write_log, caplog):
    assert len(list(CarmenLog(write_log(flaser(), "FLASER 3 1.0 2.0", "", " ")))) == 1
    assert caplog.records[0].levelno == logging.WARNING
    assert "line 2" in caplog.text


def test_a_last_line_that_ends_in_zeros_costs_only_itself(write_log, caplog):
    assert len(list(CarmenLog(write_log(flaser(), flaser()[:10].encode() + b"\0" * 50, end=b"")))) == 1
    assert "line 2" in caplog.text


def test_a_whole_last_line_needs_no_line_feed(write_log, caplog):
    assert len(list(CarmenLog(write_log(flaser(), flaser(2.0), end=b"")))) == 2
    assert not caplog.records


def test_a_wrong_last_line_is_an_error(write_log):
    with pytest.raises(LogFormatError, match="line 2: FLASER of 3 ranges with 15 fields"):
        list(CarmenLog(write_log(flaser(), flaser() + " 1.0")))


def packed_scans(count):
    rng = np.random.default_rng(2)
    lines = [flaser(float(i), ranges=rng.uniform(1, 9, 180).round(3).tolist()) for i in range(count)]
    return gzip.compress(("\n".join(lines) + "\n").encode())


@pytest.mark.parametrize("cut", [1, 8, 40, 200])
def test_a_gzip_file_cut_short_costs_only_its_last_line(tmp_path, caplog, cut):
    path = tmp_path / "run.clf.gz"
    path.write_bytes(packed_scans(50)[:-cut])
    stamps = [frame.stamp for frame in CarmenLog(path)]
    assert stamps == list(map(float, range(50 if cut <= 8 else 49)))
    assert "run.clf.gz: the gzip data end early" in caplog.text
    assert ("line 50: skipped" in caplog.text) == (cut > 8)


@pytest.mark.parametrize("where", [8, 20, 100, 300])
def test_a_gzip_file_with_a_damaged_end_costs_only_that_end(tmp_path, caplog, where):
    content = bytearray(packed_scans(50))
    content[-where : -where + 6] = bytes(byte ^ 0xFF for byte in content[-where : -where + 6])
    path = tmp_path / "run.clf.gz"
    path.write_bytes(content)
    stamps = [frame.stamp for frame in CarmenLog(path)]
    assert len(stamps) >= 48
    assert stamps[:48] == list(map(float, range(48)))
    assert "the gzip data" in caplog.text


def test_garbage_after_a_gzip_file_costs_nothing(tmp_path, caplog):
    path = tmp_path / "run.clf.gz"
    path.write_bytes(packed_scans(5) + b"garbage")
    assert len(list(CarmenLog(path))) == 5
    assert "damaged" in caplog.text


def test_a_gzip_file_damaged_long_before_its_end_is_an_error(tmp_path):
    content = bytearray(packed_scans(200))
    middle = len(content) // 2
    assert middle > 2 * GZIP_CHUNK_BYTES
    content[middle : middle + 2000] = random.Random(3).randbytes(2000)
    path = tmp_path / "run.clf.gz"
    path.write_bytes(content)
    frames = []
    with pytest.raises(LogFormatError):
        frames.extend(CarmenLog(path))
    (tmp_path / "head.gz").write_bytes(b"\x1f\x8bgarbage")
    with pytest.raises(LogFormatError, match=r"head\.gz: the gzip data are damaged"):
        CarmenLog(tmp_path / "head.gz")


finite = st.floats(allow_nan=False, allow_infinity=False)
coordinates = st.tuples(finite, finite, st.floats(-1e3, 1e3))
some_ranges = st.lists(st.floats(0.0, allow_nan=False), min_size=1, max_size=12)
stamps = st.floats(0.0, 59.0)
records = st.one_of(
    st.tuples(st.just("FLASER"), stamps, coordinates, some_ranges),
    st.tuples(st.just("ROBOTLASER1"), stamps, coordinates, some_ranges),
    st.tuples(st.just("ODOM"), stamps, coordinates, st.none()),
)


def formatted(record):
    kind, stamp, coordinates, ranges = record
    if kind == "ODOM":
        return odom(stamp, coordinates)
    if kind == "FLASER":
        return flaser(stamp, ranges, coordinates)
    return robotlaser(stamp, ranges, coordinates, range_limit=math.inf)


@given(st.lists(records, min_size=1, max_size=8), st.booleans())
def test_what_is_written_is_what_is_read(some_records, compress):
    some_records.append(("FLASER", 0.5, (0.0, 0.0, 0.0), [1.0]))
    text = "".join(formatted(record) + "\n" for record in some_records).encode()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        path.write_bytes(gzip.compress(text) if compress else text)
        frames = list(CarmenLog(path))
    expected = sorted(some_records, key=lambda record: record[1])
    for frame, (_, stamp, (x, y, theta), ranges) in zip(frames, expected, strict=True):
        assert frame.stamp == stamp
        assert frame.pose_odom_robot.tolist() == [x, y, wrap_angle(theta)]
        assert (None if frame.scan is None else frame.scan.ranges.tolist()) == ranges


words = st.sampled_from(
    ["FLASER", "ROBOTLASER1", "ODOM", "PARAM", "robot_frontlaser_offset", "1", "2", "-1", "nan", "\n"]
)
mixed = st.lists(words | st.text(max_size=4), max_size=30).map(lambda tokens: " ".join(tokens).encode())


@pytest.mark.slow
@given(st.one_of(mixed, st.binary(max_size=300), st.binary(max_size=50).map(lambda tail: b"\x1f\x8b\x08\0" + tail)))
def test_anything_gives_frames_or_one_of_our_errors(content):
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        for variant in (content, gzip.compress(content)):
            path.write_bytes(variant)
            frames, error = [], None
            try:
                frames = list(CarmenLog(path))
            except CwlfError as raised:
                error = raised
            assert any(frame.scan is not None for frame in frames) or str(path) in str(error)


@pytest.mark.slow
def test_the_intel_log_is_read_whole_and_sorted(intel_log):
    log = CarmenLog(intel_log)
    frames = list(log)
    stamps = np.array([frame.stamp for frame in frames])
    assert log.name == "intel-lab"
    assert len(frames) == 13631
    assert sum(frame.scan is not None for frame in frames) == 7584
    assert (np.diff(stamps) >= 0.0).all()
    assert stamps[-1] - stamps[0] == pytest.approx(2690, abs=2)
    assert {len(frame.scan) for frame in frames if frame.scan is not None} == {180}
    assert log.progress == 1.0
