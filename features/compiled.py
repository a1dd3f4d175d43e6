# pyright: standard
"""How kernels are compiled, and where the machine code is kept from one run to the next.

A kernel has the types of its arguments written at it, so that it is compiled or loaded when its module is imported,
and never while it runs. Into its machine code goes what it calls and each constant that it reads, also from other
modules. It is kept in a folder that is named after the text of its module and of all modules of ours that this one
imports, directly or not: whatever of it is edited, the kernel is compiled again.
"""

import hashlib
import logging
import os
import platform
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

import llvmlite
import numba
from llvmlite import binding
from numba import njit, types
from numba.core import config
from numba.core.event import Event, Listener, install_listener

logger = logging.getLogger(__name__)

PACKAGES = "features", "drivers", "sim", "slam"
"""Whose text counts; of the libraries it is the versions of those that compile."""

UNUSED_DAYS = 7
"""Folders that nobody has used for so long are removed when a new one is made; two versions in turn keep theirs."""

READ_ONLY = types.Array(types.float64, 1, "C", readonly=True)
READ_ONLY_ROWS = types.Array(types.float64, 2, "C", readonly=True)
"""Arrays that come from outside and are only read: those that may be written to fit, too."""

_IMPORT = re.compile(rb"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import\b[ \t]*(\([^)]*\)|.*)|import[ \t]+(.*))", re.MULTILINE)

_config: Any = config
_config_lock = Lock()

Decorator = Callable[[Callable[..., Any]], Any]


def kernel(*argument_types: types.Type, **options: Any) -> Decorator:
    """Compile a function that Python calls, or load it, for arguments of these types and no others.

    Parameters
    ----------
    argument_types : one each. A call with what cannot be converted to them is a TypeError.
    options : of :func:`numba.njit`.
    """

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = njit(error_model="numpy", **options)(function)
        folder = str(_kept_in(Path(function.__code__.co_filename)))
        # Other libraries that numba compiles keep their code where they always did.
        with _config_lock:
            before, _config.CACHE_DIR = _config.CACHE_DIR, folder
            try:
                dispatcher.enable_caching()
            finally:
                _config.CACHE_DIR = before
        with install_listener("numba:compile", _notice):
            dispatcher.compile(argument_types)
        dispatcher.disable_compile()
        return dispatcher

    return decorate


def inner(**options: Any) -> Decorator:
    """Mark a function that kernels call: it is compiled into each of them, by the types that they give it.

    Parameters
    ----------
    options : of :func:`numba.njit`.
    """
    return njit(error_model="numpy", **options)


class _Notice(Listener):
    """Says once, before the first kernel is compiled, that this takes its time."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: Event) -> None:
        """Hear that a function is about to be compiled; one that is loaded is not heard of."""
        if not self._said:
            self._said = True
            logger.info("compiling for this computer, once: that takes about a minute")

    def on_end(self, event: Event) -> None:
        """Hear that it is compiled."""


_notice = _Notice()


@cache
def _kept_in(file: Path) -> Path:
    """Folder of the kernels of a module; it is there and can be written to."""
    folder = _root() / f"{file.stem}-{digest(file)}"
    new = not folder.exists()
    folder.mkdir(exist_ok=True)
    os.utime(folder)
    if new:
        _remove_unused(folder.parent)
    return folder


def digest(file: Path) -> str:
    """Sum up what the machine code of a module's kernels depends on, 20 hexadecimal digits."""
    found, waiting = set[Path](), [file]
    while waiting:
        if (each := waiting.pop()) not in found:
            found.add(each)
            waiting.extend(_source(each)[1])
    total = hashlib.sha256(_machine())
    for each in sorted(found):
        total.update(each.name.encode() + _source(each)[0])
    return total.hexdigest()[:20]


@cache
def _source(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Hash of the text of a module, and the files of our modules that it imports."""
    text = file.read_bytes()
    names: list[str] = []
    for match in _IMPORT.finditer(text):
        module, imported, modules = (group.decode() if group else "" for group in match.groups())
        names += [module, *(f"{module}.{name}" for name in re.findall(r"\w+", imported))] if module else []
        names += re.findall(r"[\w.]+", modules)
    files = (_file_of(name) for name in names if name.split(".")[0] in PACKAGES)
    return hashlib.sha256(text).digest(), tuple(each for each in files if each is not None)


@cache
def _file_of(module: str) -> Path | None:
    """File of a module of ours, None where there is no module of this name."""
    path = Path(__file__).parents[1].joinpath(*module.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)


@cache
def _machine() -> bytes:
    """Name what compiles, and the processor that it compiles for."""
    parts = (
        numba.__version__,
        llvmlite.__version__,
        platform.python_version(),
        binding.get_host_cpu_name(),
        binding.get_host_cpu_features().flatten(),
    )
    return "\n".join(parts).encode()


@cache
def _root() -> Path:
    """Folder of all that is kept, of every version of the program; in the temporary directory where it must be."""
    try:
        root = _user_cache() / "cwlf-slam"
        root.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=root).close()
    except (OSError, RuntimeError) as error:  # RuntimeError: the user has no home
        root = _temporary_root()
        logger.warning("compiled code is kept in %s: %s", root, error)
    return root


def _user_cache() -> Path:
    """Folder of the user's caches; the one that numba is told has precedence."""
    if _config.CACHE_DIR:
        return Path(_config.CACHE_DIR)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def _temporary_root() -> Path:
    """Folder of this user in the temporary directory. What is loaded from it is run: no other may have made it."""
    if sys.platform == "win32":
        user = 0
    else:
        user = os.getuid()
    root = Path(tempfile.gettempdir(), f"cwlf-slam-{user}")
    root.mkdir(mode=0o700, exist_ok=True)
    made_by = root.lstat()
    if sys.platform != "win32" and (made_by.st_uid != user or made_by.st_mode & 0o022):
        return Path(tempfile.mkdtemp(prefix="cwlf-slam-"))
    return root


def _remove_unused(root: Path) -> None:
    """Remove the folders that no process has used for :data:`UNUSED_DAYS`."""
    for folder in root.iterdir():
        # Another process may remove it at the same time.
        with suppress(OSError):
            if time.time() - folder.stat().st_mtime > 86_400.0 * UNUSED_DAYS:
                shutil.rmtree(folder)
