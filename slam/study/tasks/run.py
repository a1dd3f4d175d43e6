# pyright: reportUnknownMemberType=false
# dask leaves the types of some arguments open.
"""Tasks of a study on the processes of this machine or of a cluster, by dask.distributed.

A task is a function of the settings, its number and its seed, and of nothing else; what it yields goes into the
journal as it arrives and is put together by number. So neither how many workers there are nor which of them is first
makes a difference.
"""

import logging
import signal
import traceback
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dask.config
import numpy as np
from distributed import Client, Future, LocalCluster, Worker, as_completed
from pydantic import BaseModel

from slam.errors import RunFolderError, StudyError
from slam.run.program import fingerprint
from slam.run.progress_bar import ProgressBar
from slam.study.tasks.journal import Journal, identity

Work = Callable[[Any, int, int], Any]
"""A task: settings, number of the task and its seed to what it yields, in terms of JSON."""

FAILURES = "failures.txt"
CONNECT_S = 10.0
"""A scheduler that does not answer for so long is not there [s]."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A task that ended with an error; the same seed brings it about again."""

    task: int
    seed: int
    error: str
    trace: str

    def __str__(self) -> str:
        return f"task {self.task} (seed {self.seed}) failed: {self.error}"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the tasks of a study yielded, by number, and which failed, in the order of their numbers."""

    results: dict[int, Any]
    failures: list[Failure]


def task_seed(seed: int, task: int) -> int:
    """Seed of a task, independent of those of all others of the study."""
    return int(np.random.SeedSequence(seed, spawn_key=(task,)).generate_state(1, np.uint64)[0] >> np.uint64(1))


@contextmanager
def pool(scheduler: str | None = None, workers: int | None = None) -> Generator[Client]:
    """Connect to the workers of a study.

    Parameters
    ----------
    scheduler : address of a dask scheduler that is there, ``tcp://host:port``; by default this machine's processes are
        used.
    workers : processes of this machine, by default one a core; not with a scheduler.

    Raises
    ------
    StudyError
        There is no scheduler at the address.
    """
    logging.getLogger("distributed").setLevel(logging.WARNING)
    with _workers_here(workers) if scheduler is None else _connected(scheduler) as client:
        try:
            yield client
        except (KeyboardInterrupt, StudyError):
            # That workers are killed, or no scheduler is left to take leave of, is no news then.
            for name in ("distributed", "distributed.client"):
                logging.getLogger(name).setLevel(logging.CRITICAL)
            raise


@contextmanager
def _workers_here(workers: int | None) -> Generator[Client]:
    # One thread each: a task hardly ever lets go of the interpreter. Dask sees to it that a worker's linear algebra has
    # no threads either. Its page of diagnostics stays on this machine, at any free port; its profiler, which looks at a
    # worker a hundred times a second, is off.
    with (
        dask.config.set({"distributed.worker.profile.enabled": False}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            preload=[__name__],
        ) as cluster,  # pyright: ignore[reportUnknownVariableType]  # dask leaves it open
        Client(cluster) as client,
    ):
        yield client


def _connected(scheduler: str) -> Client:
    try:
        return Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise StudyError(f"no dask scheduler answers at {scheduler}: {error}") from None


def dask_setup(worker: Worker) -> None:
    """Let a Ctrl-C, which a terminal sends to all processes, end the study alone; dask calls this in a new worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.getLogger("distributed.worker.state_machine").setLevel(logging.ERROR)  # tasks given up are no news then


def run_tasks(client: Client, folder: Path, study: str, settings: BaseModel, work: Work, count: int) -> Outcome:
    """Do the tasks of a study that are not yet in its journal.

    Parameters
    ----------
    client : of :func:`pool`.
    folder : run folder; gets ``failures.txt`` where tasks fail.
    study, settings : what the tasks belong to; the settings have a ``seed``.
    work : does one task; a function of a module, so that other processes find it.
    count : number of tasks.

    Raises
    ------
    RunFolderError
        See :class:`slam.study.tasks.journal.Journal`.
    StudyError
        The scheduler is lost.
    """
    seeds = [task_seed(settings.seed, task) for task in range(count)]  # pyright: ignore[reportAttributeAccessIssue, reportUnknownArgumentType]  # see settings
    with Journal(folder, identity(study, settings)) as journal:
        left = [task for task in range(count) if task not in journal.results]
        failures: list[Failure] = []
        with ProgressBar(study, "tasks", begun=1.0 - len(left) / count) as progress:
            if len(left) < count:
                progress.say(f"{study}: goes on in {folder}, {count - len(left)} of {count} tasks are done")
            if not client.nthreads():
                progress.say(f"{study}: waits for workers; none is connected to the scheduler yet")
            futures = client.map(
                _perform,
                left,
                [seeds[task] for task in left],
                work=work,
                settings=settings,
                program=fingerprint(),
                pure=False,
            )
            tasks = {future.key: task for future, task in zip(futures, left, strict=True)}
            arriving = _arriving(client, futures)
            del futures  # what has arrived is given up at the worker
            for done, (future, yielded) in enumerate(arriving, start=1):
                task = tasks[future.key]
                failure = _failure(future.status, yielded)
                if failure is None:
                    journal.add(task, yielded["result"])
                else:
                    failures.append(Failure(task, seeds[task], *failure))
                    progress.say(str(failures[-1]))
                progress.update(1.0 - (len(left) - done) / count, done)
        failures.sort(key=lambda failure: failure.task)
        _write_failures(folder / FAILURES, failures)
        return Outcome(dict(sorted(journal.results.items())), failures)


def _arriving(client: Client, futures: "list[Future[Any]]") -> "Iterable[tuple[Future[Any], Any]]":
    """Tasks and what they yielded, as they end."""
    return as_completed(futures, loop=client.loop, with_results=True, raise_errors=False)


def _perform(task: int, seed: int, work: Work, settings: BaseModel, program: str) -> dict[str, Any]:
    """Do a task; its error, which another process may not be able to read, becomes text."""
    try:
        if program != fingerprint():
            raise StudyError("the worker has another version of the program or of its libraries; install the same")
        return {"result": work(settings, task, seed)}
    except Exception as error:
        return {"error": _first_line(error), "trace": traceback.format_exc()}


def _failure(status: str | None, yielded: Any) -> tuple[str, str] | None:
    """Error and trace of a task; None where it did what it should.

    Raises
    ------
    StudyError
        The task was given up, as no scheduler is left to ask for it.
    """
    if status == "finished":
        return (yielded["error"], yielded["trace"]) if "error" in yielded else None
    if status == "error":  # outside of the task: its workers died again and again, or do not have the program
        return _first_line(yielded[1]), ""
    raise StudyError("the scheduler is lost; what is done is kept, the same command goes on with it")


def _first_line(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}".partition("\n")[0]


def _write_failures(path: Path, failures: Sequence[Failure]) -> None:
    try:
        path.unlink(missing_ok=True)
        if failures:
            path.write_text("\n".join(f"{failure}\n{failure.trace}" for failure in failures), encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None


def failure_message(folder: Path, failures: Sequence[Failure], count: int) -> str:
    """Say in one line that tasks failed, and what to do."""
    return (
        f"{len(failures)} of {count} tasks failed, see {folder / FAILURES}; the others are kept in {folder}: "
        "the same command tries the failed ones again"
    )


def all_results(folder: Path, outcome: Outcome) -> list[Any]:
    """Results of all tasks, in their order.

    Raises
    ------
    StudyError
        A task failed.
    """
    if outcome.failures:
        raise StudyError(failure_message(folder, outcome.failures, len(outcome.results) + len(outcome.failures)))
    return list(outcome.results.values())
