"""Paths from files."""

import numpy as np
import pytest

from sim import WorldError
from sim.motion.waypoints import read_waypoints


@pytest.mark.parametrize(
    "text",
    [
        "1,2\n3.5,-4\n",
        "x,y\n1, 2\n3.5, -4",
        "# a path\n\n1 2\n  3.5\t-4e0\n",
        "[[1, 2], [3.5, -4]]",
        "\n [[1.0, 2.0],\n [3.5, -4]]\n",
    ],
)
def test_lines_and_json_are_read(text, tmp_path):
    path = tmp_path / "path"
    path.write_text(text)
    np.testing.assert_array_equal(read_waypoints(path), [(1.0, 2.0), (3.5, -4.0)])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "0 waypoints: expected at least two"),
        (b"1,2\n", "1 waypoints"),
        (b"[]", "0 waypoints"),
        (b"1,2\n3\n", r"line 2: \['3'\]: expected x and y"),
        (b"1,2\n3,4,5\n", "line 2"),
        (b"1,2\nx,y\n", "line 2"),
        (b"1,2\n3,nan\n", r"line 2: \(3, nan\): expected finite"),
        (b"[[1, 2], [3, Infinity]]", r"waypoint 1: \(3, inf\): expected finite"),
        (b"[[1, 2], 3]", "waypoint 1: 3: expected x and y"),
        (b"[[1, 2], [3, null]]", "waypoint 1"),
        (b"[[1, 2], ", "no JSON"),
        (b"\xff\xfe", "is not text"),
    ],
)
def test_what_is_no_path_is_one_line(content, message, tmp_path):
    path = tmp_path / "path.csv"
    path.write_bytes(content)
    with pytest.raises(WorldError, match=message) as caught:
        read_waypoints(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none_is_one_line(tmp_path):
    with pytest.raises(WorldError, match="cannot be read"):
        read_waypoints(tmp_path / "missing.csv")
