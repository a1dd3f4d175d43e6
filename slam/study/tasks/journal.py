"""What the finished tasks of a study yielded, kept in its run folder until its tables are written."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pydantic import BaseModel

from slam.errors import RunFolderError
from slam.run.program import fingerprint

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

JOURNAL = "tasks.jsonl"


def identity(study: str, settings: BaseModel) -> dict[str, Any]:
    """Say what two studies must share for the tasks of one to be those of the other: the first line of a journal."""
    return {"study": study, "program": fingerprint()} | settings.model_dump(mode="json")


class Journal:
    """An append-only file, one task a line, that only one process writes; a context manager.

    A line that a sudden end cut short is taken off again when the file is opened.

    Parameters
    ----------
    folder : run folder.
    owner : the study, see :func:`identity`.

    Attributes
    ----------
    results : what each finished task yielded, by number of the task.

    Raises
    ------
    RunFolderError
        The tasks there are of another study, another process is at it, or the file is damaged or cannot be written.
    """

    def __init__(self, folder: Path, owner: Mapping[str, Any]) -> None:
        self._path = folder / JOURNAL
        try:
            self._file = self._path.open("a+b")
        except OSError as error:
            raise self._unusable(error) from None
        try:
            if not _lock(self._file.fileno()):
                raise RunFolderError(f"{folder}: another process is at this study; wait for it or choose another --out")
            lines = self._whole_lines()
            if lines:
                check_owner(folder, lines[0], owner)
            else:
                self._append(owner)
            self.results: dict[int, Any] = {line["task"]: line["result"] for line in lines[1:]}
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def add(self, task: int, result: Any) -> None:
        """Keep what a task yielded; what JSON has comes back as it is."""
        text = self._append({"task": task, "result": result})
        self.results[task] = json.loads(text)["result"]  # as a later run would find it

    def _append(self, line: Mapping[str, Any]) -> str:
        text = json.dumps(line, allow_nan=False)
        try:
            self._file.write(text.encode() + b"\n")
            self._file.flush()
        except OSError as error:
            raise self._unusable(error) from None
        return text

    def _whole_lines(self) -> list[dict[str, Any]]:
        self._file.seek(0)
        text = self._file.read()
        whole = text[: text.rfind(b"\n") + 1]
        if len(whole) < len(text):
            self._file.truncate(len(whole))
        try:
            return [json.loads(line) for line in whole.splitlines()]
        except ValueError:
            raise RunFolderError(f"{self._path}: is damaged; give --overwrite to begin anew") from None

    def _unusable(self, error: OSError) -> RunFolderError:
        return RunFolderError(f"{self._path}: cannot be written: {error.strerror or error}")


def owner_of(folder: Path) -> dict[str, Any] | None:
    """Which study has its tasks in a folder; nothing yet is an empty one, None is no study, or a damaged one."""
    try:
        with (folder / JOURNAL).open("rb") as file:
            line = file.readline()
        return json.loads(line) if line.endswith(b"\n") else {}
    except (OSError, ValueError):
        return None


def check_owner(folder: Path, found: Mapping[str, Any], owner: Mapping[str, Any]) -> None:
    """Refuse the tasks of another study.

    Raises
    ------
    RunFolderError
        Something differs; it says what.
    """
    for name in dict.fromkeys([*found, *owner]):
        before, now = found.get(name), owner.get(name)
        if before != now:
            what = "another version of the program" if name == "program" else f"{name} = {before!r}, not {now!r}"
            raise RunFolderError(
                f"{folder}: holds a study begun with {what}; choose another --out or give --overwrite to begin anew"
            )


def discard(folder: Path) -> None:
    """Remove the journal of a folder, if there is one."""
    (folder / JOURNAL).unlink(missing_ok=True)


def _lock(descriptor: int) -> bool:
    """Whether this process now is the only one that writes; the system lets go of it however the process ends."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
