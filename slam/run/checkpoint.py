"""Checkpoints: the state of a stopped run in one file of its folder, from which it is resumed."""

import hashlib
import io
import json
import os
import pickle
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from slam.errors import RunFolderError
from slam.pipeline import Slam
from slam.run.program import fingerprint

CHECKPOINT = "checkpoint"

FORMAT = "cwlf-checkpoint"

OWN_PACKAGES = ("drivers", "features", "slam")

VALUES = {
    ("builtins", "complex"),
    ("collections", "deque"),
    ("numpy", "dtype"),
    ("numpy", "ndarray"),
    ("numpy._core.multiarray", "_reconstruct"),
    ("numpy._core.multiarray", "scalar"),
    ("numpy._core.numeric", "_frombuffer"),
}
"""What a checkpoint may be made of beside our own classes."""


@dataclass(frozen=True, slots=True)
class LogPosition:
    """How far a run has come.

    Parameters
    ----------
    log : name of its source.
    records : frames that were processed.
    digest : of these frames, see :func:`slam.run.frame_digest.extend_digest`.
    """

    log: str
    records: int = 0
    digest: bytes = b""


def write_checkpoint(folder: Path, slam: Slam, position: LogPosition) -> None:
    """Write the state of a run; if the program is killed meanwhile, the previous checkpoint remains.

    Raises
    ------
    RunFolderError
        The file cannot be written.
    """
    state = pickle.dumps(slam, protocol=5)
    header = asdict(position) | {
        "format": FORMAT,
        "program": fingerprint(),
        "digest": position.digest.hex(),
        "state": hashlib.blake2b(state).hexdigest(),
    }
    path = folder / CHECKPOINT
    part = path.with_suffix(".part")
    try:
        with part.open("wb") as file:
            file.write(json.dumps(header).encode() + b"\n")
            file.write(state)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def read_checkpoint(folder: Path) -> tuple[Slam, LogPosition]:
    """Read a stopped run back.

    Raises
    ------
    RunFolderError
        There is none, the run is complete, the file is damaged, or another version of the program wrote it.
    """
    path = folder / CHECKPOINT
    try:
        with path.open("rb") as file:
            line, state = file.readline(), file.read()
    except FileNotFoundError:
        raise RunFolderError(f"{folder}: {_why_none(folder)}") from None
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror or error}") from None
    header = _header(line)
    if header is None or hashlib.blake2b(state).hexdigest() != header["state"]:
        raise RunFolderError(f"{path}: is damaged; run without --resume, with --overwrite, to begin anew")
    if header["program"] != fingerprint():
        raise RunFolderError(
            f"{path}: is of another version of the program or its libraries; run without --resume, with --overwrite, "
            "to begin anew"
        )
    try:
        slam = _Unpickler(io.BytesIO(state)).load()
    except pickle.UnpicklingError as error:
        raise RunFolderError(f"{path}: is no checkpoint: {error}") from None
    return slam, LogPosition(header["log"], header["records"], bytes.fromhex(header["digest"]))


def discard_checkpoint(folder: Path) -> None:
    """Remove the checkpoint of a folder, if there is one."""
    for name in (CHECKPOINT, f"{CHECKPOINT}.part"):
        (folder / name).unlink(missing_ok=True)


def _why_none(folder: Path) -> str:
    from slam.run.folder import METRICS

    if not folder.is_dir():
        return "no such run folder"
    if (folder / METRICS).is_file():
        return "the run is complete, there is nothing to resume"
    return f"holds no {CHECKPOINT} to resume from; run without --resume"


def _header(line: bytes) -> Mapping[str, Any] | None:
    try:
        header: dict[str, Any] | list[Any] | str | float | None = json.loads(line)
    except ValueError:
        return None
    return header if isinstance(header, dict) and header.get("format") == FORMAT else None


class _Unpickler(pickle.Unpickler):
    """Makes arrays and classes of ours, nothing else: a file must not run code of its own."""

    def find_class(self, module_name: str, global_name: str) -> Any:
        found = super().find_class(module_name, global_name)
        own = isinstance(found, type) and found.__module__.partition(".")[0] in OWN_PACKAGES
        if own or (module_name, global_name) in VALUES:
            return found
        raise pickle.UnpicklingError(f"{module_name}.{global_name} does not belong in a checkpoint")
