"""Measure how much the rules of slam matter: python docs/measure_rules.py [NAME ...].

A name is that of a field in slam/rules.py, or of several: "loop", "odometry.registration", "odometry.far".
Each field is halved and doubled, one at a time (of a probability the chance that it leaves), and two logs of the folder
CWLF_DATA (default ../shared/data) are run: MIT CSAIL, and every 5th scan of the Intel Research Lab. Printed is a table
in Markdown. A row takes some 15 s on a quiet machine.
"""

import os
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, cast

from drivers.frame import Frame, SourceInfo
from drivers.open_log import open_log
from drivers.subsampling import Subsampled
from features.errors import CwlfError
from slam.config_file import load_config
from slam.evaluation.metrics import ate
from slam.evaluation.relations import read_relations, relations
from slam.pipeline import Slam
from slam.result.trajectory import Trajectory
from slam.result.trajectory_file import read_trajectory_file
from slam.rules import SlamRules

DATA = Path(os.environ.get("CWLF_DATA", Path(__file__).parents[1] / ".." / "shared" / "data"))
PROBABILITIES = {"prediction", "no_slip", "consistent", "one_landmark", "possible", "level"}


def main() -> None:
    """Print a row for each field that was asked for, at first one for the rules as they are."""
    asked = tuple(sys.argv[1:])
    csail, intel = Log("mit-csail.clf.gz", 1), Log("intel-lab.clf.gz", 5)
    reference = read_trajectory_file(DATA / "mit-csail-reference.txt")
    true_relations = read_relations(DATA / "intel-lab.relations")

    def cells(rules: SlamRules) -> str:
        on_csail, on_intel = csail.run(rules), intel.run(rules)
        first = "fails" if on_csail is None else f"{1e3 * ate(reference, on_csail).rmse_m:.0f}"
        if on_intel is None:
            return f"{first} | fails"
        error = relations(true_relations, on_intel)
        return f"{first} | {1e3 * error.translation_mean_m:.0f}, {error.rotation_mean_deg:.2f}"

    print("| field | CSAIL, halved | Intel, halved | CSAIL, doubled | Intel, doubled |\n|---|---|---|---|---|")
    print(f"| as it is | {cells(SlamRules())} | | |", flush=True)
    for path, value in _leaves(SlamRules(), ()):
        name = ".".join(path)
        if not asked or f"{name}.".startswith(tuple(f"{each}." for each in asked)):
            halved, doubled = (cells(_changed(SlamRules(), path, _scaled(path[-1], value, by))) for by in (0.5, 2.0))
            print(f"| `{name}` | {halved} | {doubled} |", flush=True)


class Log:
    """A real log in memory.

    Parameters
    ----------
    name : of its file.
    every : the n-th of its scans are used.
    """

    def __init__(self, name: str, every: int) -> None:
        source = Subsampled(open_log(DATA / name), every)
        self._frames: list[Frame] = list(source)
        self._info: SourceInfo = source.info

    def run(self, rules: SlamRules) -> Trajectory | None:
        """Trajectory by these rules; None where the run fails."""
        slam = Slam(load_config(None, source=self._info), rules=rules)
        try:
            for frame in self._frames:
                slam.process(frame)
            return slam.finish().trajectory
        except (CwlfError, ValueError):
            return None


def _leaves(rules: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    for field in fields(rules):
        value = getattr(rules, field.name)
        if is_dataclass(value):
            yield from _leaves(value, (*path, field.name))
        else:
            yield (*path, field.name), value


def _scaled(name: str, value: Any, by: float) -> Any:
    if name in PROBABILITIES:
        return 1.0 - by * (1.0 - value)
    if isinstance(value, tuple):
        return tuple(by * each for each in cast(tuple[float, ...], value))
    return max(1, round(by * value)) if isinstance(value, int) else by * value


def _changed(rules: Any, path: tuple[str, ...], value: Any) -> Any:
    first, *rest = path
    return replace(rules, **{first: _changed(getattr(rules, first), tuple(rest), value) if rest else value})


main()
