"""The reader of a file is chosen by its name, else by its content."""

import pytest

from sim import WorldError, find_site
from sim.worlds.formats.world_file import read_site

JSON = '{"format": "cwlf-world", "version": 1, "walls": [{"points": [[0, 0], [1, 0]]}]}'
BOX = "<collision><geometry><box><size>1 1 1</size></box></geometry></collision>"
SDF = f"<sdf><model name='m'><link>{BOX}</link></model></sdf>"


@pytest.mark.parametrize(
    ("name", "content", "walls"),
    [("w.json", JSON, 1), ("w.JSON", JSON, 1), ("w", "\n " + JSON, 1), ("w.txt", SDF, 4), ("w.world", SDF, 4)],
)
def test_format_by_suffix_or_content(name, content, walls, tmp_path):
    path = tmp_path / name
    path.write_text(content)
    assert len(find_site(str(path)).walls) == walls


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("w.txt", "walls", "no format of a world: expected .json, .sdf"),
        ("w.pgm", "P5", "give the map's YAML"),
        ("w.json", SDF, "JSON"),
        ("w.sdf", JSON, "no XML"),
    ],
)
def test_what_has_no_reader_is_one_line(name, content, message, tmp_path):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(WorldError, match=message) as caught:
        read_site(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_file_that_is_none_is_one_line(tmp_path):
    with pytest.raises(WorldError, match="is a directory"):
        read_site(tmp_path)
    with pytest.raises(WorldError, match="No such file"):
        read_site(tmp_path / "w.json")
