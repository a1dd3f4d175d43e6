"""How much faster studies are on more workers: measured on this machine, and what follows for more of them."""

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from distributed import Client
from pydantic import BaseModel, ConfigDict

from slam.errors import RunFolderError, StudyError
from slam.study.monte_carlo.runs import MonteCarloSettings, run_task, study_config
from slam.study.output import fill, markdown_table
from slam.study.tasks.journal import discard
from slam.study.tasks.run import pool, run_tasks, task_seed

EMPTY_TASKS = 1000
"""Tasks that do nothing, to measure what a task costs beside its work."""

RUNS_OF_ROUND = 4
"""Runs that each worker does in a round."""

AT_REST = 0.1
"""The machine is at rest where others keep fewer cores busy than this."""

BEYOND_TASKS = 200, 10_000
BEYOND_WORKERS = 2, 8, 32, 128, 512


@dataclass(frozen=True, slots=True)
class Round:
    """The same share of work for one worker and then for each of all workers.

    Parameters
    ----------
    one, every : runs per second by one worker and by all of them [1/s].
    others : cores that the rest of the machine kept busy meanwhile; NaN where the system does not report it.
    """

    one: float
    every: float
    others: float

    @property
    def speed_up(self) -> float:
        """How many times as fast all workers are."""
        return self.every / self.one


@dataclass(frozen=True, slots=True)
class Costs:
    """What the time of a study is made of.

    Parameters
    ----------
    serial_s : of the command with a task of next to nothing: start, workers, tables, pictures [s].
    task_s : of one task on one worker [s].
    overhead_s : of one task at the scheduler and in the journal [s].
    data_bytes : of one task in the journal.
    """

    serial_s: float
    task_s: float
    overhead_s: float
    data_bytes: float

    def wall_s(self, tasks: int, workers: int) -> float:
        """Time of a study [s]: the serial part, then the slower of the workers and the scheduler."""
        return self.serial_s + max(tasks * self.task_s / workers, tasks * self.overhead_s, self.task_s)

    def speed_up(self, tasks: int, workers: int) -> float:
        """Ratio of the time with one worker."""
        return self.wall_s(tasks, 1) / self.wall_s(tasks, workers)


class _NoSettings(BaseModel):
    model_config = ConfigDict(frozen=True)

    seed: int = 0


def nothing(settings: BaseModel, task: int, seed: int) -> int:
    """Do nothing; a task without work."""
    return task


def make_scaling_page(docs: Path, runs: Path, rounds: int) -> list[str]:
    """Time one worker and all cores in turn, and fill ``docs/scaling.md``.

    Parameters
    ----------
    docs, runs : folders; what is timed has its own below ``runs``.
    rounds : how often each is timed.

    Raises
    ------
    RunFolderError
        A file cannot be read or written.
    StudyError
        A study failed.
    """
    cores = os.cpu_count() or 1
    try:
        runs.mkdir(parents=True, exist_ok=True)
        serial_s = min(_command_s(runs / "serial") for _ in range(3))
        overhead_s = _overhead_s(runs, cores)
        taken = _rounds(runs, cores, rounds)
        quiet = [of for of in taken if of.others < AT_REST]
        costs = Costs(serial_s, 1.0 / median(of.one for of in quiet or taken), overhead_s, _result_bytes())
        page = docs / "scaling.md"
        blocks = {"measured": _measured(taken, quiet, cores), "costs": _costs(costs), "beyond": _beyond(costs)}
        page.write_text(fill(page.read_text(encoding="utf-8"), blocks), encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{error.filename}: {error.strerror}") from None
    return [
        f"{cores} workers are {median(of.speed_up for of in quiet or taken):.2f} times as fast as one: median of "
        f"{len(quiet or taken)} rounds{' at rest' if quiet else ', the machine never being at rest'}",
        f"filled {page}",
    ]


def _command_s(folder: Path) -> float:
    """Time of a command with a task of next to nothing, from the start of Python to the last picture [s]."""
    discard(folder)
    began = time.monotonic()
    command = [sys.executable, "-m", "slam.cli.main", "study", "slam", "--seeds", "1", "--limit", "1", "--workers", "1"]
    ended = subprocess.run([*command, "--out", folder, "--overwrite"], stdout=subprocess.DEVNULL, check=False)
    if ended.returncode:
        raise StudyError(f"the study in {folder} failed; what it said is above")
    return time.monotonic() - began


def _rounds(folder: Path, cores: int, count: int) -> list[Round]:
    """Time both in turn, so that a slow moment of the machine falls on both."""
    rounds: list[Round] = []
    with pool(workers=1) as one, pool(workers=cores) as every:
        for _ in range(count + 1):
            machine, own, began = _machine_s(), _own_s(one, every), time.monotonic()
            rate_one = _rate(one, folder, RUNS_OF_ROUND)
            rate_every = _rate(every, folder, RUNS_OF_ROUND * cores)
            wall_s, own_s, machine_now = time.monotonic() - began, _own_s(one, every) - own, _machine_s()
            rounds.append(Round(rate_one, rate_every, (machine_now - machine - own_s) / wall_s))
    return rounds[1:]  # in the first one workers import the program


def _rate(client: Client, folder: Path, count: int) -> float:
    """Do so many runs; return how many a second [1/s]."""
    settings = MonteCarloSettings(world="room", seeds=count, config=study_config())
    discard(folder)
    began = time.monotonic()
    outcome = run_tasks(client, folder, "slam", settings, run_task, count)
    taken_s = time.monotonic() - began
    discard(folder)
    if outcome.failures:
        raise StudyError(str(outcome.failures[0]))
    return count / taken_s


def _own_s(*clients: Client) -> float:
    """Processor time of this process and of the workers so far [s]."""
    of_workers: list[dict[str, float]] = [client.run(time.process_time) for client in clients]  # pyright: ignore[reportUnknownMemberType, reportUnknownVariableType, reportAssignmentType]  # dask leaves it open; by worker
    return time.process_time() + sum(sum(of.values()) for of in of_workers)


def _machine_s() -> float:
    """Processor time that all cores have spent so far, what the host took away included [s]; NaN but on Linux."""
    try:
        line = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0]
    except OSError:
        return math.nan
    user, nice, system, _, _, irq, softirq, steal = map(int, line.split()[1:9])
    return (user + nice + system + irq + softirq + steal) / os.sysconf("SC_CLK_TCK")


def _overhead_s(folder: Path, workers: int) -> float:
    """Time of one task that does nothing [s]."""
    discard(folder)
    with pool(workers=workers) as client:
        client.wait_for_workers(workers)
        began = time.monotonic()
        run_tasks(client, folder, "nothing", _NoSettings(), nothing, EMPTY_TASKS)
        taken_s = time.monotonic() - began
    discard(folder)
    return taken_s / EMPTY_TASKS


def _result_bytes() -> int:
    """Bytes of what one run yields."""
    settings = MonteCarloSettings(world="room", seeds=1, config=study_config())
    return len(json.dumps(run_task(settings, 0, task_seed(settings.seed, 0))))


def _measured(taken: Sequence[Round], quiet: Sequence[Round], cores: int) -> str:
    rows = [
        [
            name,
            str(len(of)),
            f"{median(one.one for one in of):.3f}",
            f"{median(one.every for one in of):.3f}",
            f"{median(one.speed_up for one in of):.2f}",
            f"{min(one.speed_up for one in of):.2f} .. {max(one.speed_up for one in of):.2f}",
        ]
        for name, of in (("machine at rest", quiet), ("all", taken))
        if of
    ]
    header = ["rounds", "count", "one worker [runs/s]", f"{cores} workers [runs/s]", "times as fast", "least .. most"]
    return markdown_table(header, rows)


def _costs(costs: Costs) -> str:
    rows = [
        ["serial: start, workers, tables, pictures", f"{costs.serial_s:.1f} s"],
        ["one run through the room, on one worker", f"{costs.task_s:.2f} s"],
        ["one task at the scheduler and in the journal", f"{1e3 * costs.overhead_s:.1f} ms"],
        ["one run in the journal", f"{costs.data_bytes / 1e3:.1f} kB"],
    ]
    return markdown_table(["what", "cost"], rows)


def _beyond(costs: Costs) -> str:
    rows = [
        [str(workers)]
        + [
            cell
            for tasks in BEYOND_TASKS
            for cell in (f"{costs.wall_s(tasks, workers):,.0f}", f"{costs.speed_up(tasks, workers):,.1f}")
        ]
        for workers in BEYOND_WORKERS
    ]
    header = ["workers", *(cell for tasks in BEYOND_TASKS for cell in (f"{tasks:,} runs [s]", "times as fast"))]
    return markdown_table(header, rows)
