"""The run folder of a study: a new one, or the one in which the same study was cut short."""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Any

from slam.run.folder import claimed, default_folder
from slam.study.tasks.journal import JOURNAL, check_owner, discard, owner_of


@contextmanager
def study_folder(name: str, owner: Mapping[str, Any], out: Path | None, *, overwrite: bool) -> Generator[Path]:
    """Make the folder of a study, or take up the one that holds finished tasks of the same study.

    Parameters
    ----------
    name : of the study, for the default folder.
    owner : see :func:`slam.study.tasks.journal.identity`.
    out : folder; by default the newest of ``runs/<name>-<date>`` that holds tasks of the same study, or a new one.
    overwrite : write into a folder although it holds something else.

    Raises
    ------
    RunFolderError
        It holds something else and ``overwrite`` is False, or it cannot be made or written to.
    """
    folder = out or _unfinished(name, owner) or default_folder(name, datetime.now())
    found = owner_of(folder)
    same = found in ({}, owner)
    if overwrite and not same:
        discard(folder)
    elif found and not same:
        check_owner(folder, found, owner)
    with claimed(folder, overwrite=overwrite or same):
        yield folder


def _unfinished(name: str, owner: Mapping[str, Any]) -> Path | None:
    like = default_folder(name, datetime.now())
    stem = like.name[: -len("YYYY-mm-dd-HHMMSS")]
    folders = sorted(path.parent for path in like.parent.glob(f"{stem}*/{JOURNAL}"))
    return next((folder for folder in reversed(folders) if owner_of(folder) == owner), None)
