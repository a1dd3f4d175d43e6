"""Kernels are those of the source as it is; their code has a place of its own, and says when it takes time."""

import importlib.util
import logging
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numba import config, f8, njit
from numba.core.event import RecordingListener, install_listener

import features.compiled

HERE = Path(features.compiled.__file__).parent
Fresh = Callable[[], ModuleType]


def load(file: Path) -> ModuleType:
    """Import the module anew, as a process does that has just begun."""
    spec = importlib.util.spec_from_file_location("features.compiled", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Fresh:
    """Make processes that have just begun, of a user whose caches are below ``tmp_path / "caches"``."""
    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    return lambda: load(HERE / "compiled.py")


def double(x):
    return 2.0 * x


def square(x):
    return x * x


def folders(tmp_path: Path) -> set[str]:
    return {folder.name for folder in (tmp_path / "caches" / "cwlf-slam").iterdir()}


@pytest.mark.slow
def test_an_edited_function_of_another_file_is_compiled_into_the_kernel(tmp_path: Path) -> None:
    """Also where the file keeps its time, as after a checkout."""
    for name, text in {
        "features/__init__.py": "",
        "features/compiled.py": (HERE / "compiled.py").read_text(),
        "features/fit.py": (
            "from features.compiled import inner\n\n@inner()\ndef variance(x):\n    return 1.0 * x * x\n"
        ),
        "features/kernels.py": (
            "from numba import f8\nfrom features.compiled import kernel\nfrom features.fit import variance\n\n"
            "@kernel(f8, f8)\ndef corner(x, y):\n    return variance(x) + variance(y)\n"
        ),
    }.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    # As Python keeps no bytecode, nothing but numba's cache can be old.
    own = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}

    def corner() -> tuple[float, int]:
        """What the kernel finds in a process of its own, and how often it was loaded for that."""
        code = "from features.kernels import corner; print(corner(1.0, 2.0), *corner.stats.cache_hits.values())"
        command, environment = [sys.executable, "-c", code], os.environ | own
        printed = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        value, *loaded = printed.stdout.split()
        return float(value), sum(map(int, loaded))

    assert corner() == (5.0, 0)
    assert corner() == (5.0, 1)
    kept = set((tmp_path / "kept" / "cwlf-slam").iterdir())
    source = tmp_path / "features" / "fit.py"
    text, times = source.read_text(), source.stat()
    source.write_text(text.replace("1.0", "4.0"))
    os.utime(source, ns=(times.st_atime_ns, times.st_mtime_ns))
    assert corner() == (20.0, 0)
    assert kept < set((tmp_path / "kept" / "cwlf-slam").iterdir()), "what other versions may still use stays"


def test_what_a_kernel_is_made_of_names_its_folder(tmp_path: Path) -> None:
    shutil.copytree(HERE, tmp_path / "features", ignore=shutil.ignore_patterns("__pycache__"))

    def digest(file: str = "extraction.py") -> str:
        return load(tmp_path / "features" / "compiled.py").digest(tmp_path / "features" / file)

    before = digest()
    assert digest() == before
    assert len({digest("extraction.py"), digest("fitting/corner.py"), digest("fitting/fit_kernels.py")}) == 3
    for name in ("extraction", "fitting/fit_kernels", "segmentation/segments", "config", "feature", "se2", "compiled"):
        file = tmp_path / "features" / f"{name}.py"
        text = file.read_bytes()
        file.write_bytes(text + b"\nA = 1\n")
        assert digest() != before, f"{name}.py is compiled into the kernel, or gives it constants or types"
        file.write_bytes(text)
    assert digest() == before
    (tmp_path / "features" / "fitting" / "line_fit.py").write_text("")
    assert digest() == before, "the kernel does not hold what calls it"


@pytest.mark.parametrize(
    "line",
    [
        "from sim.room.walls import A",
        "from sim.room.walls import (\n    A,\n    B,\n)",
        "from sim.room import walls",
        "from sim.room import (\n    doors,\n    walls as w,\n)",
        "import sim.room.walls",
        "import math, sim.room.walls as walls",
        "if True:\n    from sim.room.walls import A",
        "from sim.room import C",
    ],
)
def test_however_a_constant_is_imported_its_file_counts(tmp_path: Path, line: str) -> None:
    """The last one comes by way of the package."""
    for name, text in {
        "features/compiled.py": (HERE / "compiled.py").read_text(),
        "sim/room/__init__.py": "from sim.room.walls import A as C\n",
        "sim/room/walls.py": "A = 1\n",
        "sim/kernels.py": f"{line}\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    def digest() -> str:
        return load(tmp_path / "features" / "compiled.py").digest(tmp_path / "sim" / "kernels.py")

    before = digest()
    (tmp_path / "sim/room/walls.py").write_text("A = 2\n")
    assert digest() != before


def test_a_kernel_takes_its_types_only(fresh: Fresh) -> None:
    root = fresh().kernel(f8)(double)
    assert root(3) == 6.0
    assert root(np.float32(1.5)) == 3.0
    with install_listener("numba:compile", listener := RecordingListener()):
        for wrong in (np.ones(2), "1", 1j):
            with pytest.raises(TypeError):
                root(wrong)
    assert not listener.buffer
    rows = fresh().kernel(features.compiled.READ_ONLY)(square)
    values = np.arange(3.0)
    assert rows(values).tolist() == [0.0, 1.0, 4.0]
    values.flags.writeable = False
    assert rows(values).tolist() == [0.0, 1.0, 4.0]
    with pytest.raises(TypeError):
        rows(np.arange(6.0)[::2])


def test_compiling_is_said_once_and_loading_is_not(fresh: Fresh, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "features.compiled")
    compiled = fresh()
    for function in (double, square):
        compiled.kernel(f8)(function)
    assert [(record.levelname, "compiling" in record.message) for record in caplog.records] == [("INFO", True)]
    caplog.clear()
    loaded = fresh().kernel(f8)(double)
    assert loaded(2.0) == 4.0
    assert sum(loaded.stats.cache_hits.values()) == 1
    assert not caplog.records


def test_the_code_is_below_the_cache_of_the_user_and_that_of_others_is_not(fresh: Fresh, tmp_path: Path) -> None:
    ours = fresh().kernel(f8)(double)
    assert Path(ours.stats.cache_path).is_relative_to(tmp_path / "caches" / "cwlf-slam")
    assert config.CACHE_DIR == ""
    others = njit(cache=True)(square)
    assert not Path(others.stats.cache_path).is_relative_to(tmp_path)


def test_the_folder_that_numba_is_told_is_the_root(
    fresh: Fresh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "told"))
    ours = fresh().kernel(f8)(double)
    assert Path(ours.stats.cache_path).is_relative_to(tmp_path / "told" / "cwlf-slam")
    assert str(tmp_path / "told") == config.CACHE_DIR
    assert not (tmp_path / "caches").exists()


def test_without_a_cache_of_the_user_it_is_in_the_temporary_directory(
    fresh: Fresh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "caches").write_text("a file where the folder should be")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    compiled = fresh()
    paths = [Path(compiled.kernel(f8)(function).stats.cache_path) for function in (double, square)]
    (folder,) = (tmp_path / "temporary").iterdir()
    assert all(path.is_relative_to(folder) for path in paths)
    (line,) = (record.message for record in caplog.records if record.levelname == "WARNING")
    assert str(folder) in line
    # The next process finds it, unless others may write there: what is loaded is run.
    assert sum(fresh().kernel(f8)(double).stats.cache_hits.values()) == 1
    folder.chmod(0o777)
    assert not Path(fresh().kernel(f8)(double).stats.cache_path).is_relative_to(folder)


def test_folders_that_nobody_uses_go_when_a_new_one_comes(fresh: Fresh, tmp_path: Path) -> None:
    days = 86_400.0
    fresh().kernel(f8)(double)
    (used,) = folders(tmp_path)
    for name, age in {used: 30.0, "other-version": 6.0, "old-version": 8.0}.items():
        folder = tmp_path / "caches" / "cwlf-slam" / name
        folder.mkdir(exist_ok=True)
        os.utime(folder, times=(time.time() - age * days,) * 2)
    fresh().kernel(f8)(double)
    assert folders(tmp_path) == {used, "other-version", "old-version"}, "no new folder, nothing removed"
    other = tmp_path / "kernels.py"
    other.write_text("def triple(x):\n    return 3.0 * x\n")
    fresh().kernel(f8)(load(other).triple)
    assert len(folders(tmp_path)) == 3
    assert {used, "other-version"} < folders(tmp_path), "what was in use, if only to be loaded, stays"


@pytest.mark.slow
def test_values_of_the_package_are_there_without_what_is_compiled():
    """On a new machine compiling takes a minute: a command that extracts nothing, such as `devices`, must not wait."""
    code = "import sys, features, drivers, slam.config_file; assert 'numba' not in sys.modules; features.extract"
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert done.stderr == ""
