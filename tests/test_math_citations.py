"""Every equation that the code cites exists: ours in docs/math.md, the paper's among its 48."""

import re

import pytest
from places import ROOT

MODULES = sorted(path for folder in ("features", "drivers", "sim", "slam") for path in (ROOT / folder).rglob("*.py"))
CITATION = re.compile(r"\beqs?\.\s+((?:M?\d+[a-c]?(?:\s*(?:-|,|and|or|to)\s*)?)+)", re.IGNORECASE)
NUMBER = re.compile(r"(M?)(\d+)[a-c]?(?:\s*(?:-|to)\s*M?(\d+))?")
TAG = re.compile(r"\\tag\{M(\d+)\}")


def cited(text: str) -> tuple[set[int], set[int]]:
    """Numbers of ours and of the paper's that a text cites; ``eq. M3-M6`` cites four."""
    ours: set[int] = set()
    papers: set[int] = set()
    for citation in CITATION.finditer(text):
        for mark, first, last in NUMBER.findall(citation[1]):
            (ours if mark else papers).update(range(int(first), int(last or first) + 1))
    return ours, papers


@pytest.mark.parametrize(
    ("text", "ours", "papers"),
    [
        ("carried by eq. M3-M6 of docs/math.md", {3, 4, 5, 6}, set()),
        ("eq. 23 or 34 with", set(), {23, 34}),
        ("(eq. 20-21), estimates eq. 29-30 or 35, n", set(), {20, 21, 29, 30, 35}),
        ("eq. 31-32 (``paper``) or eq. M4-M6", {4, 5, 6}, {31, 32}),
        ("eq. 11a\n    and, eq. M7.", {7}, {11}),
        ("a sequence 5", set(), set()),
    ],
)
def test_citations_are_read(text, ours, papers):
    assert cited(text) == (ours, papers)


def numbered() -> list[int]:
    """Numbers of the page's equations, in the order of the page."""
    return [int(number) for number in TAG.findall((ROOT / "docs" / "math.md").read_text(encoding="utf-8"))]


def test_the_page_numbers_its_equations_once_and_in_order():
    assert numbered() == sorted(set(numbered()))


def test_something_is_cited():
    """The pattern is not outdated: most of what the page derives is cited somewhere."""
    ours = set().union(*(cited(path.read_text(encoding="utf-8"))[0] for path in MODULES))
    assert len(ours) >= 10


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_equation_that_a_module_cites_exists(path):
    ours, papers = cited(path.read_text(encoding="utf-8"))
    assert ours <= set(numbered())
    assert papers <= set(range(1, 49))


def test_every_equation_that_the_page_cites_exists():
    ours, papers = cited((ROOT / "docs" / "math.md").read_text(encoding="utf-8"))
    assert ours <= set(numbered())
    assert papers <= set(range(1, 49))
