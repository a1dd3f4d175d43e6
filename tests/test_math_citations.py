"""Every equation that the code cites exists, ours in docs/math.md, the paper's among its 48, and its table is right."""

import re
from typing import NamedTuple

import pytest
from places import ROOT

MODULES = sorted(path for folder in ("features", "drivers", "sim", "slam") for path in (ROOT / folder).rglob("*.py"))
CITATION = re.compile(r"\beqs?\.\s+((?:M?\d+[a-c]?(?:\s*(?:-|,|and|or|to)\s*)?)+)", re.IGNORECASE)
NUMBER = re.compile(r"(M?)(\d+)[a-c]?(?:\s*(?:-|to)\s*M?(\d+))?")
TAG = re.compile(r"\\tag\{M(\d+)\}")
PAGE = (ROOT / "docs" / "math.md").read_text(encoding="utf-8")
ROW = re.compile(
    r"^\| \[(?P<title>[^]]+)]\(#(?P<anchor>[^)]+)\) \| (?P<equations>[^|]*) \| (?P<files>[^|]*) \|", re.MULTILINE
)
ROWS = list(ROW.finditer(PAGE))


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
    return [int(number) for number in TAG.findall(PAGE)]


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
    ours, papers = cited(PAGE)
    assert ours <= set(numbered())
    assert papers <= set(range(1, 49))


class Section(NamedTuple):
    """A section of the page, or what the table at its head says of one."""

    title: str
    anchor: str
    equations: list[int]


def sections() -> list[Section]:
    """Sections of the page, with the anchors that their titles make and the numbers of their equations."""
    found = []
    for part in re.split(r"^## ", PAGE, flags=re.MULTILINE)[1:]:
        title = part.partition("\n")[0]
        found.append(Section(title, title.lower().replace(" ", "-"), [int(number) for number in TAG.findall(part)]))
    return found


def equations_of(row: re.Match[str]) -> set[int]:
    """Numbers of the equations of a row of the table."""
    return cited(f"eq. {row['equations']}")[0]


def test_the_table_lists_every_section_with_its_equations_in_the_order_of_the_page():
    head = PAGE.partition("\n## ")[0]
    rows = [Section(row["title"], row["anchor"], sorted(equations_of(row))) for row in ROWS]
    assert rows == sections()
    # One table: a blank line would end it, and what follows would not be shown as rows.
    assert len(re.findall(r"(?:^\|.*\n)+", head, re.MULTILINE)) == 1


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["anchor"])
def test_the_files_of_a_row_cite_its_equations(row):
    """Each file at least one of them, and all files together every one."""
    equations = equations_of(row)
    citations = {
        file: cited((ROOT / file).read_text(encoding="utf-8"))[0] & equations
        for file in re.findall(r"`([^`]+)`", row["files"])
    }
    assert citations
    assert [file for file, found in citations.items() if not found] == []
    assert set().union(*citations.values()) == equations
