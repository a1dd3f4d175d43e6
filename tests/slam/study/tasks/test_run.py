"""Studies on workers: whatever becomes of workers and of the study itself, its files come out the same."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from places import ROOT
from pydantic import BaseModel

from slam.cli.main import main
from slam.errors import StudyError
from slam.run.program import fingerprint
from slam.study.monte_carlo.report import study_slam
from slam.study.monte_carlo.runs import MonteCarloSettings, study_config
from slam.study.paper import report
from slam.study.tasks import run as tasks
from slam.study.tasks.journal import JOURNAL, Journal
from slam.study.tasks.run import FAILURES, Outcome, pool, run_tasks, task_seed

SMALL = ("--seeds", "5", "--limit", "12", "--seed", "3")
"""A study slam of a second or so; what is below makes its settings without the command line."""


class Settings(BaseModel):
    seed: int = 1


def small_settings() -> MonteCarloSettings:
    return MonteCarloSettings(world="room", seeds=5, scans=12, seed=3, config=study_config())


def files(folder: Path) -> dict[str, bytes]:
    return {
        path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in {".csv", ".json", ".toml", ".md"}
    }


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory, client: Client) -> dict[str, bytes]:
    """Files of the small study, on two threads of this process and never disturbed."""
    folder = tmp_path_factory.mktemp("expected")
    _, failures = study_slam(client, folder, small_settings())
    assert not failures
    return files(folder)


@pytest.fixture(scope="module")
def processes() -> Iterator[Client]:
    with pool(workers=2) as connected:
        yield connected


def test_seeds_differ_between_tasks_and_studies_and_fit_an_integer_of_toml() -> None:
    seeds = {task_seed(study, task) for study in range(20) for task in range(200)}
    assert len(seeds) == 20 * 200
    assert max(seeds) < 2**63
    assert task_seed(1, 7) == task_seed(1, 7)


def test_tasks_know_their_number_and_seed_and_come_out_in_order(client: Client, tmp_path: Path) -> None:
    def work(settings: Settings, task: int, seed: int) -> list[int]:
        return [settings.seed, task, seed]

    outcome = run_tasks(client, tmp_path, "some", Settings(seed=9), work, 30)
    assert list(outcome.results.items()) == [(task, [9, task, task_seed(9, task)]) for task in range(30)]
    assert outcome.failures == []


def test_a_failed_task_is_reported_with_its_seed_and_tried_again_alone(client: Client, tmp_path: Path) -> None:
    broken, calls = tmp_path / "broken", tmp_path / "calls"
    broken.write_text("24")
    calls.mkdir()

    def work(settings: Settings, task: int, seed: int) -> int:
        (calls / str(task)).touch()
        if str(task) in broken.read_text():
            raise RuntimeError(f"no luck with {task}\nand more of it")
        return 10 * task

    outcome = run_tasks(client, tmp_path, "some", Settings(), work, 6)
    assert outcome.results == {task: 10 * task for task in (0, 1, 3, 5)}
    assert [str(failure) for failure in outcome.failures] == [
        f"task {task} (seed {task_seed(1, task)}) failed: RuntimeError: no luck with {task}" for task in (2, 4)
    ]
    written = (tmp_path / FAILURES).read_text()
    assert str(task_seed(1, 2)) in written
    assert "and more of it" in written
    broken.write_text("")
    for call in calls.iterdir():
        call.unlink()
    again = run_tasks(client, tmp_path, "some", Settings(), work, 6)
    assert {call.name for call in calls.iterdir()} == {"2", "4"}
    assert again == Outcome({task: 10 * task for task in range(6)}, [])
    assert not (tmp_path / FAILURES).exists()


def test_a_worker_with_another_program_fails_its_tasks(
    client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = iter(["mine"])
    monkeypatch.setattr(tasks, "fingerprint", lambda: next(mine, "its"))
    outcome = run_tasks(client, tmp_path, "some", Settings(), lambda *_: 1, 1)
    assert "another version" in outcome.failures[0].error


def test_a_study_that_needs_all_tasks_says_which_failed_and_keeps_the_others(
    client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(settings: object, task: int, seed: int) -> Any:
        raise RuntimeError("no luck")

    monkeypatch.setattr(report, "scan_task", work)
    settings = report.CornerSettings(environment="A", scans=60)
    with pytest.raises(StudyError, match="2 of 2 tasks failed"):
        report.study_corners(client, tmp_path, settings)
    assert {path.name for path in tmp_path.iterdir()} == {JOURNAL, FAILURES}


def test_an_existing_scheduler_is_used_and_left_running(client: Client, tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        with pool(client.scheduler.address) as connected:
            outcome = run_tasks(connected, tmp_path / name, "some", Settings(), lambda *_: 1, 3)
        assert outcome.results == {0: 1, 1: 1, 2: 1}


@pytest.mark.slow
def test_workers_have_one_thread_for_linear_algebra_and_the_same_program(processes: Client) -> None:
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    found = processes.run(lambda: [os.environ[name] for name in names])
    assert list(found.values()) == [["1", "1", "1"]] * 2
    assert set(processes.run(fingerprint).values()) == {fingerprint()}


@pytest.mark.slow
def test_a_worker_killed_changes_nothing(
    processes: Client, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add, killed = Journal.add, []

    def kill_after_first(journal: Journal, task: int, result: Any) -> None:
        add(journal, task, result)
        if not killed:
            killed.extend(processes.run(os.getpid).values())
            os.kill(killed[0], signal.SIGKILL)

    monkeypatch.setattr(Journal, "add", kill_after_first)
    _, failures = study_slam(processes, tmp_path, small_settings())
    assert killed
    assert not failures
    assert files(tmp_path) == expected


KILLED = """
import os, signal, sys
from slam.cli.main import main
from slam.study.tasks.journal import Journal

add = Journal.add

def kill_after_two(journal, task, result):
    add(journal, task, result)
    if len(journal.results) == 2:
        journal._file.write(b'{"task": 4, "resu')
        journal._file.flush()
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    Journal.add = kill_after_two
    main()
"""


@pytest.mark.slow
def test_a_killed_study_goes_on_where_it_was(
    expected: dict[str, bytes],
    client: Client,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Killed in the middle of a line, with two tasks kept; the second time it has other workers."""
    script = tmp_path / "killed.py"
    script.write_text(KILLED)
    folder = tmp_path / "study"
    command = ["study", "slam", *SMALL, "--out", str(folder)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    killed = subprocess.run([sys.executable, script, *command, "--workers", "1"], env=environment, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert {path.name for path in folder.iterdir()} == {JOURNAL}

    monkeypatch.setattr(sys, "argv", ["cwlf-slam", *command, "--scheduler", client.scheduler.address])
    with pytest.raises(SystemExit) as leaving:
        main()
    assert not leaving.value.code
    assert "2 of 5 tasks are done" in capfd.readouterr().err
    assert files(folder) == expected
    assert JOURNAL not in {path.name for path in folder.iterdir()}
