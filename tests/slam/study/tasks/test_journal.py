"""What a study leaves behind when it is cut short, and who may go on with it."""

import json
import random
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from slam.errors import RunFolderError
from slam.study.tasks.folder import study_folder
from slam.study.tasks.journal import JOURNAL, Journal, identity, owner_of


class Settings(BaseModel):
    seeds: int = 5
    seed: int = 1


OWNER = identity("some", Settings())


def filled(folder: Path, results: dict[int, Any]) -> Path:
    with Journal(folder, OWNER) as journal:
        for task, result in results.items():
            journal.add(task, result)
    return folder / JOURNAL


def results_in(folder: Path) -> dict[int, Any]:
    with Journal(folder, OWNER) as journal:
        return journal.results


def test_what_was_added_in_any_order_comes_back_exactly(tmp_path: Path) -> None:
    numbers = random.Random(4)
    results = {task: {"x": [numbers.gauss(0.0, 1e-7) for _ in range(5)], "none": None} for task in range(20)}
    shuffled = list(results)
    numbers.shuffle(shuffled)
    filled(tmp_path, {task: results[task] for task in shuffled})
    assert results_in(tmp_path) == results


def test_a_result_is_the_same_at_once_and_read_back(tmp_path: Path) -> None:
    with Journal(tmp_path, OWNER) as journal:
        journal.add(0, {"pair": (1.0, 2.0)})
        assert journal.results == {0: {"pair": [1.0, 2.0]}}
    assert results_in(tmp_path) == {0: {"pair": [1.0, 2.0]}}


@pytest.mark.parametrize("cut", [1, 5, 14])
def test_a_line_cut_short_is_its_task_not_done(tmp_path: Path, cut: int) -> None:
    path = filled(tmp_path, {0: 1.5, 1: 2.5})
    path.write_bytes(path.read_bytes()[:-cut])
    with Journal(tmp_path, OWNER) as journal:
        assert journal.results == {0: 1.5}
        journal.add(2, 3.5)
    assert results_in(tmp_path) == {0: 1.5, 2: 3.5}


@pytest.mark.parametrize("kept", [0, 10])
def test_a_study_that_ended_within_its_first_line_begins_anew(tmp_path: Path, kept: int) -> None:
    path = filled(tmp_path, {})
    path.write_bytes(path.read_bytes()[:kept])
    with study_folder("some", OWNER, tmp_path, overwrite=False):
        assert results_in(tmp_path) == {}
    assert owner_of(tmp_path) == OWNER


def test_a_damaged_line_is_refused_and_overwritten_on_demand(tmp_path: Path) -> None:
    path = filled(tmp_path, {0: 1.5, 1: 2.5})
    path.write_bytes(b"#" + path.read_bytes())
    with pytest.raises(RunFolderError, match="damaged"):
        Journal(tmp_path, OWNER)
    with pytest.raises(RunFolderError, match="--overwrite"), study_folder("some", OWNER, tmp_path, overwrite=False):
        pass
    with study_folder("some", OWNER, tmp_path, overwrite=True):
        assert results_in(tmp_path) == {}


@pytest.mark.parametrize(
    ("owner", "reason"),
    [
        (identity("some", Settings(seeds=6)), "seeds = 5, not 6"),
        (identity("other", Settings()), "study = 'some', not 'other'"),
        (OWNER | {"program": "0123"}, "another version of the program"),
    ],
)
def test_tasks_of_another_study_are_refused_with_what_differs(tmp_path: Path, owner: Any, reason: str) -> None:
    filled(tmp_path, {0: 1.5})
    with pytest.raises(RunFolderError, match=reason):
        Journal(tmp_path, owner)
    with pytest.raises(RunFolderError, match=reason), study_folder("some", owner, tmp_path, overwrite=False):
        pass
    assert results_in(tmp_path) == {0: 1.5}
    with study_folder("some", owner, tmp_path, overwrite=True), Journal(tmp_path, owner) as journal:
        assert journal.results == {}


def test_only_one_process_writes_a_study(tmp_path: Path) -> None:
    pytest.importorskip("fcntl", reason="no locks on this system")
    with Journal(tmp_path, OWNER) as journal:
        with pytest.raises(RunFolderError, match="another process"):
            Journal(tmp_path, OWNER)
        journal.add(0, 1.5)
    assert results_in(tmp_path) == {0: 1.5}


def test_the_same_command_takes_up_the_newest_unfinished_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in (
        "some-2026-01-01-000000",
        "some-2026-01-03-000000",
        "some-2026-01-02-000000",
        "other-2026-01-04-000000",
    ):
        folder = tmp_path / "runs" / name
        folder.mkdir(parents=True)
        filled(folder, {0: 1.5})
    finished = tmp_path / "runs" / "some-2026-01-05-000000"
    finished.mkdir()
    (finished / "summary.json").write_text(json.dumps({}))
    with study_folder("some", OWNER, None, overwrite=False) as folder:
        assert folder.name == "some-2026-01-03-000000"
    with study_folder("some", identity("some", Settings(seed=2)), None, overwrite=False) as folder:
        assert not list(folder.iterdir())
