"""Rooms: folders of a dozen modules at most, each of which says what it promises."""

import ast
from pathlib import Path

import pytest
from places import ROOT

PACKAGES = "features", "drivers", "sim", "slam"
MOST_MODULES = 12

ROOMS = sorted(path.parent for package in PACKAGES for path in (ROOT / package).rglob("__init__.py"))


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_a_room_has_a_dozen_modules_at_most_and_says_what_it_promises(room: Path) -> None:
    modules = [path for path in room.glob("*.py") if path.name != "__init__.py"]
    assert len(modules) <= MOST_MODULES
    assert ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: str(room.relative_to(ROOT)))
def test_every_folder_of_a_package_is_a_room(room: Path) -> None:
    folders = {path.parent for path in room.rglob("*.py")}
    assert folders <= set(ROOMS)
