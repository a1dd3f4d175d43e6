"""Worlds of our own format: what docs/worlds.md shows is read, what is wrong is named."""

import json
import re

import numpy as np
import pytest
from places import ROOT

from sim import WorldError, findings
from sim.worlds.formats.json_world import WorldFile
from sim.worlds.formats.world_file import read_site

DOCS = ROOT / "docs"


def written(folder, **keys):
    path = folder / "mine.json"
    path.write_text(json.dumps({"format": "cwlf-world", "version": 1, "walls": [{"points": [[0, 0], [1, 0]]}]} | keys))
    return path


def test_lines_outlines_and_glass_become_walls(tmp_path):
    walls = [
        {"points": [[0, 0], [4, 0], [4, 3.5]], "closed": True},
        {"points": [[1, 1], [2, 1], [2, 2]], "glass": True},
    ]
    site = read_site(written(tmp_path, walls=walls, waypoints=[[1, 2], [3, 2]], name="hall"))
    expected = [(0, 0, 4, 0), (4, 0, 4, 3.5), (4, 3.5, 0, 0), (1, 1, 2, 1), (2, 1, 2, 2)]
    np.testing.assert_array_equal(site.walls, expected)
    np.testing.assert_array_equal(site.world().glass, [False, False, False, True, True])
    np.testing.assert_array_equal(site.waypoints, [(1, 2), (3, 2)])
    assert site.name == "hall"


def test_name_and_path_may_be_left_out(tmp_path):
    site = read_site(written(tmp_path))
    assert site.name == "mine"
    assert site.waypoints is None


def test_the_example_of_the_documentation_is_a_world_without_fault(tmp_path):
    (example,) = re.findall(r"```json\n(.*?)```", (DOCS / "worlds.md").read_text(encoding="utf-8"), flags=re.DOTALL)
    path = tmp_path / "example.json"
    path.write_text(example)
    site = read_site(path)
    assert findings(site.walls) == []
    assert site.glass.any()
    assert site.waypoints is not None


def test_the_schema_of_the_documentation_is_the_one_that_is_checked():
    """Where it is not: ``json.dumps(WorldFile.model_json_schema(), indent=2)`` is what the file should hold."""
    assert json.loads((DOCS / "world.schema.json").read_text(encoding="utf-8")) == WorldFile.model_json_schema()


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"walls": []}, "walls: Tuple should have at least 1 item"),
        ({"walls": [{"points": [[0, 0]]}]}, r"walls.0.points: Tuple should have at least 2 items"),
        ({"walls": [{"points": [[0, 0], [1, "a"]]}]}, r"walls.0.points.1.1: Input should be a valid number"),
        ({"walls": [{"points": [[0, 0], [1, float("nan")]]}]}, r"walls.0.points.1.1: Input should be a finite number"),
        (
            {"walls": [{"points": [[0, 0], [1e7, 1]]}]},
            r"walls.0.points.1.0: Input should be less than or equal to 1000000",
        ),
        ({"walls": [{"points": [[0, 0], [1, 2, 3]]}]}, r"walls.0.points.1"),
        ({"walls": [{"points": [[0, 0], [1, 1]], "clsoed": True}]}, r"walls.0.clsoed: no such key"),
        ({"waypoints": [[0, 0]]}, "waypoints: Tuple should have at least 2 items"),
        ({"version": 2}, "version: Input should be 1"),
        ({"format": "other", "version": 2}, r"format: Input should be 'cwlf-world' \(and 1 more\)"),
    ],
)
def test_what_is_wrong_is_named_by_its_key(keys, message, tmp_path):
    path = written(tmp_path, **keys)
    with pytest.raises(WorldError, match=message) as caught:
        read_site(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"{", b"{}", b"[]", b"", b"\xff\xfe\x00", b'{"format": "cwlf-world"}'])
def test_what_is_no_world_is_one_line(content, tmp_path):
    path = tmp_path / "broken.json"
    path.write_bytes(content)
    with pytest.raises(WorldError) as caught:
        read_site(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
