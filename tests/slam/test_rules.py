"""Rules come from one place, each has its reason in docs/math.md, and a changed one changes what it names."""

import ast
import importlib
import re
from dataclasses import fields, is_dataclass, replace
from functools import cache
from numbers import Number
from typing import Any

import numpy as np
import pytest
from places import ROOT

from sim import room_run
from slam.config_file import load_config
from slam.pipeline import Slam
from slam.rules import SlamRules

ROOMS = "odometry", "filter", "graph", "loop", "trust"
LAYOUT = {
    "slam.odometry.line_map": {
        *("WALL_X", "WALL_Y", "NORMAL_X", "NORMAL_Y", "LENGTH", "CENTER", "VAR_OFFSET", "VAR_ANGLE", "WALL_FIELDS"),
        *("Y_ON_X", "X_ON_Y"),
    },
    "slam.odometry.registration_kernel": {
        *("WEIGHT", "JACOBIAN_X", "JACOBIAN_Y", "JACOBIAN_TURN", "RESIDUAL", "CERTAINTY"),
    },
    "slam.odometry.beams": {"HIDDEN", "IN_SIGHT", "PASSED", "UNKNOWN", "ON", "BEFORE", "THROUGH"},
    "slam.filter.ekf": {"POSE_DIM"},
    "slam.filter.landmark_table": {"ACTIVE", "MERGED", "REMOVED"},
    "slam.graph.multi_hypothesis": {"ROOM"},
    "slam.loop.geometric_hashing": {"DIRECTION", "SIGNATURE", "PAIR_FIELDS", "FAR_APART"},
}
"""Constants that say where something is kept, and decide nothing."""

MODULES = sorted(path for room in ROOMS for path in (ROOT / "slam" / room).glob("*.py"))
SECTION = (ROOT / "docs" / "math.md").read_text(encoding="utf-8").partition("\n## Rules\n")[2]
TABLES = {
    table.partition("\n")[0]: dict(re.findall(r"^\| `([\w.]+)` \| ([^|]*) \|", table, re.MULTILINE))
    for table in re.split(r"^### ", SECTION, flags=re.MULTILINE)[1:]
}


def numeric(value: Any) -> bool:
    return isinstance(value, (Number, np.ndarray)) or (isinstance(value, (tuple, list)) and all(map(numeric, value)))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_no_constant_of_a_module_decides_an_estimate(path):
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    body = ast.parse(path.read_text(encoding="utf-8")).body
    targets = [target for node in body if isinstance(node, ast.Assign) for target in node.targets]
    targets += [node.target for node in body if isinstance(node, ast.AnnAssign)]
    names = {node.id for target in targets for node in ast.walk(target) if isinstance(node, ast.Name)}
    module = importlib.import_module(name)
    constants = {each for each in names if each.isupper() and numeric(getattr(module, each))}
    assert constants == LAYOUT.get(name, set())


def rules_types(rules: Any) -> dict[str, Any]:
    """Every rules type that is reached from some rules, with its defaults."""
    found = {}
    for field in fields(rules):
        value = getattr(rules, field.name)
        if is_dataclass(value):
            found |= {type(value).__name__: type(value)()} | rules_types(value)
    return found


def leaves(rules: Any) -> dict[str, Any]:
    """Values of the fields, of rules within them only those that are not the defaults of their type."""
    found = {}
    for field in fields(rules):
        value = getattr(rules, field.name)
        if is_dataclass(value):
            usual = leaves(type(value)())
            found |= {f"{field.name}.{name}": each for name, each in leaves(value).items() if each != usual[name]}
        else:
            found[field.name] = value
    return found


TYPES = rules_types(SlamRules())


def test_the_page_has_a_table_for_each_rules_type():
    assert {name for name in TABLES if name.endswith("Rules")} == set(TYPES)


@pytest.mark.parametrize("name", TYPES)
def test_the_page_has_every_field_with_its_value(name):
    values = leaves(TYPES[name])
    assert list(TABLES[name]) == list(values)
    for field, cell in TABLES[name].items():
        numbers = np.array([float(number) for number in re.findall(r"(?<![\w^/])-?\d+(?:\.\d+)?", cell)])
        told = np.radians(numbers) if cell.endswith("deg") else numbers
        if cell.endswith("1/m^2"):
            told = told[:1]
        np.testing.assert_allclose(told, np.atleast_1d(values[field]), rtol=1e-12, err_msg=field)


@pytest.mark.parametrize("name", TYPES)
def test_the_docstring_names_every_field(name):
    documented = re.findall(r"^    ([\w, ]+) : ", type(TYPES[name]).__doc__, re.MULTILINE)
    assert [each for names in documented for each in names.split(", ")] == [field.name for field in fields(TYPES[name])]


@cache
def outcome(rules: SlamRules) -> dict[str, float]:
    """Figures of a drive round the room, where each place may be seen again after half a metre."""
    run = room_run(3)
    config = load_config(None, source=run.info)
    config = config.model_copy(update={"loop": config.loop.model_copy(update={"apart_m": 0.5})})
    slam = Slam(config, rules=rules)
    for _, frame in zip(range(200), run, strict=False):
        slam.process(frame)
    metrics = slam.finish().metrics
    return {
        "second attempts": metrics.registrations.second_attempts,
        "calibration": abs(metrics.wheels.travel),
        "matched": metrics.observations.matched,
        "searches": metrics.closures.proposed_near,
        "windows": metrics.nis.windows if metrics.nis else 0,
        "variance": slam.solution.pose_covs(np.array([0]))[0, 0, 0],
    }


@pytest.mark.parametrize(
    ("room", "changes", "figure", "more"),
    [
        ("odometry", {"sure_share": 1.1}, "second attempts", True),
        ("wheels", {"sigma_travel": 1e-6}, "calibration", False),
        ("filter", {"most_nodes": 1}, "matched", False),
        ("loop", {"spacing": 100.0}, "searches", False),
        ("graph", {"anchor_position": 0.1}, "variance", True),
        ("trust", {"window": 5}, "windows", True),
    ],
)
def test_the_rules_of_a_run_reach_its_parts(room, changes, figure, more):
    usual = SlamRules()
    before = outcome(usual)[figure]
    after = outcome(replace(usual, **{room: replace(getattr(usual, room), **changes)}))[figure]
    assert after > before if more else after < 0.5 * before
