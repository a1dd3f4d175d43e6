"""Runs tests against chosen faults, one at a time, and counts those that no test notices.

``python tests/mutants/run.py [part ...]`` runs the parts that are named, or all of them, in copies of the packages; the
faults and the tests that should notice them stand in ``mutants.toml``.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

REPOSITORY = Path(__file__).parents[2]
PACKAGES = "features", "drivers", "sim", "slam", "tests"
AT_ONCE = 2

LEAST_NOTICED = 0.95
"""Share of the mutants that the tests have to notice."""

TIME_LIMIT = 300.0
"""Tests that run longer have noticed the mutant: a loop may not end [s]."""

PASSED, FAILED = 0, 1
"""What pytest returns."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A fault: in ``file`` the snippet ``old``, which occurs there once, becomes ``new``.

    Parameters
    ----------
    part, breaks : where it belongs, and what it breaks, in words.
    file, old, new : relative to the repository, and the snippets.
    tests : arguments of pytest.
    """

    part: str
    breaks: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]


def mutants() -> list[Mutant]:
    parts = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text(encoding="utf-8"))
    return [
        Mutant(part, **{**fields, "tests": tuple(fields.get("tests", contents["tests"]))})
        for part, contents in parts.items()
        for fields in contents["mutants"]
    ]


def main() -> int:
    every = mutants()
    known = dict.fromkeys(mutant.part for mutant in every)
    parts = sys.argv[1:] or known
    if not set(parts) <= set(known):
        print(f"there are mutants of: {', '.join(known)}")
        return 2
    chosen = [mutant for mutant in every if mutant.part in parts]
    with tempfile.TemporaryDirectory(prefix="cwlf-mutants-") as root, ThreadPoolExecutor(AT_ONCE) as pool:
        copies = _Copies(Path(root))
        # A test that fails anyway would notice everything.
        tests = sorted({test for mutant in chosen for test in mutant.tests})
        failing = [test for test, passed in zip(tests, pool.map(copies.passes, tests), strict=True) if not passed]
        if failing:
            print(f"fails without any mutant: {', '.join(failing)}")
            return 2
        counts = {"noticed": 0, "survived": 0, "broken": 0}
        for mutant, (outcome, seconds) in zip(chosen, pool.map(copies.outcome, chosen), strict=True):
            counts[outcome] += 1
            print(f"{mutant.part:17} {outcome:9} {seconds:4.0f} s  {mutant.breaks}", flush=True)
    share = counts["noticed"] / len(chosen)
    print(f"{', '.join(f'{count} {outcome}' for outcome, count in counts.items())}: {share:.1%} noticed")
    return int(share < LEAST_NOTICED or counts["broken"] > 0)


class _Copies:
    """Copies of the packages, each for one mutant at a time.

    What is compiled stays with them, and is compiled again only where it depends on what a mutant has changed.
    """

    def __init__(self, root: Path) -> None:
        self._free: SimpleQueue[Path] = SimpleQueue()
        for number in range(AT_ONCE):
            folder = root / str(number)
            for name in PACKAGES:
                shutil.copytree(REPOSITORY / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
            shutil.copy2(REPOSITORY / "pyproject.toml", folder)
            self._free.put(folder)

    def passes(self, test: str) -> bool:
        """Whether a test passes without a mutant."""
        folder = self._free.get()
        try:
            return _run_tests(folder, (test,)) == PASSED
        finally:
            self._free.put(folder)

    def outcome(self, mutant: Mutant) -> tuple[str, float]:
        """What becomes of a mutant, and how long that takes [s]; ``broken`` is one of which no test can be run."""
        folder, start = self._free.get(), time.monotonic()
        original, changed = REPOSITORY / mutant.file, folder / mutant.file
        try:
            text = original.read_text(encoding="utf-8")
            if text.count(mutant.old) != 1:
                return "broken", 0.0
            changed.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
            returned = _run_tests(folder, mutant.tests)
            return {PASSED: "survived", FAILED: "noticed"}.get(returned, "broken"), time.monotonic() - start
        finally:
            # With its old time, by which compiled code is found again.
            shutil.copy2(original, changed)
            self._free.put(folder)


def _run_tests(folder: Path, tests: tuple[str, ...]) -> int:
    """Return what pytest returns."""
    paths = os.pathsep.join([str(folder), str(folder / "tests")])
    try:
        return subprocess.run(
            [
                *(sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"),
                *("--hypothesis-profile", "mutants", *tests),
            ],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": paths, "NUMBA_CACHE_DIR": str(folder / "kernels")},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=TIME_LIMIT,
            check=False,
        ).returncode
    except subprocess.TimeoutExpired:
        return FAILED


if __name__ == "__main__":
    sys.exit(main())
