"""What the README and the examples show runs as it is shown, and the names that the pages give exist."""

import importlib
import re
import runpy
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from places import ROOT

from features.scan import LaserScan
from features.se2 import Array, pose, transform
from features.signature import Kind
from sim import Lidar, room
from slam import Trajectory, ate
from slam.config import SlamConfig

SNIPPETS = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.DOTALL)

EXTENSIONS = [("own_association.py", 33, 0), ("own_back_end.py", 33, 0), ("own_features.py", 4, 2)]
"""Examples of docs/extending.md, with the corners and columns of the world that they map."""


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A short CARMEN log in the current directory, under the name that the README uses."""
    rng = np.random.default_rng(0)
    lidar = Lidar.of_preset("sick-lms")
    lines = []
    for number in range(30):
        robot = pose(2.0 + 0.05 * number, 2.0, 0.01 * number)
        ranges = np.minimum(lidar.scan(room(), robot, 0.0, rng).ranges, 81.83)
        readings = " ".join(f"{value:.2f}" for value in ranges)
        x, y, theta = robot
        lines.append(
            f"FLASER {len(ranges)} {readings} {x} {y} {theta} {x} {y} {theta} {number / 5:.3f} host {number / 5:.3f}"
        )
    path = tmp_path / "my.log"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_the_library_snippet_of_the_readme_runs(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(log.parent)
    names: dict[str, object] = {}
    exec(compile(SNIPPETS[0], "README.md", "exec"), names)
    assert (log.parent / "runs" / "mine" / "map.png").is_file()
    assert len(names["result"].trajectory) == 30  # type: ignore[attr-defined]


def test_the_features_snippet_of_the_readme_prints_corners(capsys: pytest.CaptureFixture[str]) -> None:
    scan = Lidar.of_preset("rplidar-s1").scan(room(), pose(2.0, 2.0, 0.5), 0.0, np.random.default_rng(1))
    exec(compile(SNIPPETS[1], "README.md", "exec"), {"ranges": scan.ranges, "angles": scan.angles})
    assert len(capsys.readouterr().out.splitlines()) >= 4


def test_the_readme_has_no_snippet_that_is_not_run() -> None:
    assert len(SNIPPETS) == 2


def run_page(page: str) -> dict[str, object]:
    snippets = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, object] = {}
    exec(compile("\n".join(snippets), page, "exec"), names)
    return names


def test_the_snippet_of_the_emulator_page_runs() -> None:
    assert run_page("emulator.md")["decoded"] > 10000  # type: ignore[operator]


def test_the_snippet_of_the_simulator_page_runs() -> None:
    names = run_page("simulator.md")
    assert (names["found"].person_ids == 0).any()  # type: ignore[attr-defined]


def test_every_example_runs(log: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = {
        "map_a_log.py": [str(log), str(log.parent / "run")],
        "corners_of_a_scan.py": [],
        "draw_floor_plans.py": [str(log.parent / "plans")],
    }
    examples = sorted((ROOT / "examples").glob("*.py"))
    assert {example.name for example in examples} == {*arguments, *(name for name, *_ in EXTENSIONS)}
    for name, values in arguments.items():
        monkeypatch.setattr(sys, "argv", [name, *values])
        runpy.run_path(str(ROOT / "examples" / name), run_name="__main__")
        assert capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(("name", "corners", "columns"), EXTENSIONS)
def test_an_extension_maps_a_world_without_a_change_in_the_packages(name: str, corners: int, columns: int) -> None:
    names = runpy.run_path(str(ROOT / "examples" / name), run_name="__main__")
    run, result = names["run"], names["result"]
    error = ate(Trajectory(run.stamps, run.poses_world_robot), result.trajectory)
    # The scanner's noise is 20 mm, and many beams make a pose: what comes along errs by 2 mm here.
    assert error.rmse_m < 0.005
    landmarks = transform(error.pose_truth_estimate, result.landmarks.positions)
    points = result.landmarks.signatures.kinds == Kind.POINT
    assert mapped(run.world.corners, landmarks[~points]) == corners
    assert mapped(names.get("COLUMNS", np.empty((0, 2))), landmarks[points]) == points.sum() == columns


def mapped(true: Array, landmarks: Array) -> int:
    """How many true points have a landmark within 20 mm."""
    distances = np.hypot(*(true[:, None] - landmarks).T)
    return int((distances < 0.02).any(axis=0).sum()) if len(landmarks) else 0


CODE = re.compile(r"`([^`\n]+)`")
PAGES_OF_NAMES = ("architecture.md", "glossary.md")
PAGES = sorted([*(ROOT / "docs").glob("*.md"), *ROOT.glob("*.md")])


def quoted(page: str, pattern: str) -> list[str]:
    """What a page of ``docs`` quotes as code and matches a pattern, each once."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return sorted({code for code in CODE.findall(text) if re.fullmatch(pattern, code)})


def resolve(name: str) -> object:
    """Module, or attribute of one, that a dotted name stands for."""
    module, attributes = name, list[str]()
    while True:
        try:
            found: object = importlib.import_module(module)
            break
        except ModuleNotFoundError:
            module, _, attribute = module.rpartition(".")
            attributes.insert(0, attribute)
            if not module:
                raise
    for attribute in attributes:
        found = getattr(found, attribute)
    return found


def test_a_name_that_does_not_exist_is_noticed():
    assert resolve("features.scan.LaserScan.ranges") is LaserScan.ranges
    with pytest.raises(AttributeError):
        resolve("features.scan.LaserScan.colours")
    with pytest.raises(AttributeError):
        resolve("features.scanner")


@pytest.mark.parametrize(
    ("page", "name"),
    [(page, name) for page in PAGES_OF_NAMES for name in quoted(page, r"(features|drivers|sim|slam)(\.\w+)+(?<!\.py)")],
)
def test_every_name_of_the_code_that_a_page_gives_exists(page: str, name: str):
    resolve(name)


@pytest.mark.parametrize(
    ("page", "path"),
    [
        (page, path)
        for page in PAGES_OF_NAMES
        for path in quoted(page, r"(features|drivers|sim|slam|tests|docs)/[\w/.]*")
    ],
)
def test_every_file_that_a_page_gives_exists(page: str, path: str):
    assert (ROOT / path).exists()


@pytest.mark.parametrize("page", PAGES_OF_NAMES)
def test_every_configuration_key_that_a_page_gives_exists(page: str):
    sections = {name: field.annotation for name, field in SlamConfig.model_fields.items()}
    for key in quoted(page, rf"({'|'.join(sections)})\.\w+"):
        section, _, field = key.partition(".")
        assert field in sections[section].model_fields, key  # type: ignore[union-attr]


def test_the_glossary_explains_each_term_once():
    rows = re.findall(r"^\| ([^|]+) \|", (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"), re.MULTILINE)
    terms = [term for row in rows if row not in ("term", "---") for term in row.split(", ")]
    assert len(terms) > 80
    assert len(terms) == len(set(terms))


def test_the_glossary_lists_each_reference_that_it_cites():
    table, _, references = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").partition("## References")
    known = set(re.findall(r"^- ([^:]+):", references, re.MULTILINE))
    cells = [row.split(" | ")[2] for row in table.splitlines() if row.startswith("| ") and " | `" in row]
    cited = {re.sub(r", (ch|eq)\. .*", "", cell) for cell in cells} - {"-"}
    assert cited == known


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_between_the_pages_leads_somewhere(page: Path):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        linked = page if not path else page.parent / path
        assert linked.exists(), target
        if anchor:
            titles = re.findall(r"^#+ (.*)$", linked.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles], target


def test_the_architecture_page_shows_the_layers_of_slam_as_they_are_checked():
    linter = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    (layers,) = [
        contract["layers"] for contract in linter["contracts"] if "slam.pipeline" in contract.get("layers", ())
    ]
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    (table,) = re.findall(r"^\| room \| task \|\n\|---\|---\|\n((?:\|.*\n)+)", text, re.MULTILINE)
    rows = [re.findall(r"slam\.\w+", row.split(" | ")[0]) for row in table.splitlines()]
    assert rows == [layer.split(" | ") for layer in layers]
