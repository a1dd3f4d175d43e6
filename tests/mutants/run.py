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
COPIED = "features", "drivers", "sim", "slam", "tests", "docs", "pyproject.toml"
AT_ONCE = 2

LEAST_NOTICED = 0.95
"""Share of the mutants that the tests have to notice."""

TIME_LIMIT = 300.0
"""Tests that run longer have noticed the mutant, such as a loop that does not end [s]."""

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
    equivalent : why nothing can notice it; empty where something can.
    """

    part: str
    breaks: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    equivalent: str = ""


def mutants() -> list[Mutant]:
    parts = tomllib.loads(Path(__file__).with_name("mutants.toml").read_text(encoding="utf-8"))
    return [
        Mutant(part, **{**fields, "tests": tuple(fields.get("tests", contents["tests"]))})
        for part, contents in parts.items()
        for fields in contents["mutants"]
    ]


def main() -> int:
    every = mutants()
    parts = sys.argv[1:] or list(dict.fromkeys(mutant.part for mutant in every))
    if unknown := set(parts) - {mutant.part for mutant in every}:
        print(f"no such part: {', '.join(sorted(unknown))}")
        return 2
    chosen = [mutant for mutant in every if mutant.part in parts and not mutant.equivalent]
    copies: SimpleQueue[Path] = SimpleQueue()
    with tempfile.TemporaryDirectory(prefix="cwlf-mutants-") as root, ThreadPoolExecutor(AT_ONCE) as pool:
        for number in range(AT_ONCE):
            copies.put(_copy(Path(root, str(number))))
        # A test that fails anyway would notice everything.
        tests = sorted({test for mutant in chosen for test in mutant.tests})
        for test, found in zip(tests, pool.map(lambda test: _passes(copies, (test,)), tests), strict=True):
            if found != "survived":
                print(f"fails without any mutant: {test}")
                return 2
        counts = {"noticed": 0, "survived": 0, "broken": 0}
        for mutant, (found, seconds) in zip(chosen, pool.map(lambda each: _try(copies, each), chosen), strict=True):
            counts[found] += 1
            print(f"{mutant.part:17} {found:9} {seconds:4.0f} s  {mutant.breaks}", flush=True)
    share = counts["noticed"] / len(chosen)
    print(f"{', '.join(f'{count} {found}' for found, count in counts.items())}: {share:.1%} noticed")
    return int(share < LEAST_NOTICED or counts["broken"] > 0)


def _copy(folder: Path) -> Path:
    for name in COPIED:
        source = REPOSITORY / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, folder / name)
    return folder


def _try(copies: "SimpleQueue[Path]", mutant: Mutant) -> tuple[str, float]:
    """What becomes of a mutant, and how long that takes [s]."""
    start = time.monotonic()
    return _passes(copies, mutant.tests, mutant), time.monotonic() - start


def _passes(copies: "SimpleQueue[Path]", tests: tuple[str, ...], mutant: Mutant | None = None) -> str:
    """Whether tests pass in a copy: ``survived``, else ``noticed``; ``broken`` where they cannot be run."""
    folder = copies.get()
    try:
        if mutant is None:
            return _run(folder, tests)
        text = (REPOSITORY / mutant.file).read_text(encoding="utf-8")
        if text.count(mutant.old) != 1:
            return "broken"
        (folder / mutant.file).write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        try:
            return _run(folder, tests)
        finally:
            # With its old time, by which compiled code is found again.
            shutil.copy2(REPOSITORY / mutant.file, folder / mutant.file)
    finally:
        copies.put(folder)


def _run(folder: Path, tests: tuple[str, ...]) -> str:
    paths = os.pathsep.join([str(folder), str(folder / "tests")])
    try:
        ended = subprocess.run(
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
        return "noticed"
    return {PASSED: "survived", FAILED: "noticed"}.get(ended, "broken")


if __name__ == "__main__":
    sys.exit(main())
