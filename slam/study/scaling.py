"""How much faster studies are on more workers: measured on this machine, and what follows for more of them."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from slam.errors import RunFolderError, StudyError
from slam.study.journal import discard
from slam.study.monte_carlo import MonteCarloSettings, run_task, world_config
from slam.study.output import markdown_table
from slam.study.page import fill
from slam.study.tasks import pool, run_tasks, task_seed

EMPTY_TASKS = 1000
"""Tasks that do nothing, to measure what a task costs beside its work."""

COMPARED = "runs.csv", "nees.csv", "summary.json", "settings.toml", "page.md"
BEYOND_TASKS = 200, 10_000
BEYOND_WORKERS = 2, 8, 32, 128, 512


@dataclass(frozen=True, slots=True)
class Timing:
    """A study from the command to its end.

    Parameters
    ----------
    wall_s : time that passed [s].
    own_s : processor time of all its processes [s].
    others : cores that the rest of the machine kept busy meanwhile; None where the system does not tell.
    """

    wall_s: float
    own_s: float
    others: float | None


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


def make_scaling_page(docs: Path, runs: Path, seeds: int) -> list[str]:
    """Time ``study slam`` on one worker and on all cores, one after the other, and fill ``docs/scaling.md``.

    Parameters
    ----------
    docs, runs : folders; below ``runs`` the studies have theirs.
    seeds : simulated runs of each study.

    Raises
    ------
    RunFolderError
        A file cannot be read or written.
    StudyError
        A study failed, or its files differ between one worker and all.
    """
    cores = os.cpu_count() or 1
    try:
        runs.mkdir(parents=True, exist_ok=True)
        serial = _timed(runs / "serial", "--seeds", "1", "--limit", "1", "--workers", "1")
        timings = {
            workers: _timed(runs / f"workers-{workers}", "--seeds", str(seeds), "--workers", str(workers))
            for workers in (1, cores)
        }
        for name in COMPARED:
            if len({(runs / f"workers-{workers}" / name).read_bytes() for workers in timings}) != 1:
                raise StudyError(f"{name} in {runs} differs between one worker and {cores}")
        task_s = (timings[1].wall_s - serial.wall_s) / seeds
        costs = Costs(serial.wall_s, task_s, _overhead_s(runs, cores), _result_bytes())
        page = docs / "scaling.md"
        blocks = {"measured": _measured(timings, seeds), "costs": _costs(costs), "beyond": _beyond(costs)}
        page.write_text(fill(page.read_text(encoding="utf-8"), blocks), encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"{error.filename}: {error.strerror}") from None
    speed_up = timings[1].wall_s / timings[cores].wall_s
    return [
        f"{seeds} runs: {timings[1].wall_s:.0f} s on one worker, {timings[cores].wall_s:.0f} s on {cores}: "
        f"{speed_up:.2f} times as fast, the same files",
        f"filled {page}",
    ]


def _timed(folder: Path, *options: str) -> Timing:
    """Time ``study slam`` as a user gives it, in a process of its own."""
    discard(folder)
    machine, own, began = _machine_s(), _children_s(), time.monotonic()
    command = [sys.executable, "-m", "slam.cli", "study", "slam", *options, "--out", str(folder), "--overwrite"]
    if subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode:
        raise StudyError(f"the study in {folder} failed; what it said is above")
    wall_s, own_s, machine_now = time.monotonic() - began, _children_s() - own, _machine_s()
    if machine is None or machine_now is None:
        return Timing(wall_s, own_s, None)
    return Timing(wall_s, own_s, (machine_now - machine - own_s) / wall_s)


def _children_s() -> float:
    """Processor time of all processes that this one has started and that ended [s]."""
    times = os.times()
    return times.children_user + times.children_system


def _machine_s() -> float | None:
    """Processor time that all cores have spent so far, what the host took away included [s]; Linux only."""
    try:
        line = Path("/proc/stat").read_text(encoding="ascii").splitlines()[0]
    except OSError:
        return None
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
    settings = MonteCarloSettings(world="room", seeds=1, config=world_config("room", None))
    return len(json.dumps(run_task(settings, 0, task_seed(settings.seed, 0))))


def _measured(timings: Mapping[int, Timing], seeds: int) -> str:
    rows = [
        [
            str(workers),
            f"{of.wall_s:.1f}",
            f"{seeds / of.wall_s:.2f}",
            f"{timings[1].wall_s / of.wall_s:.2f}",
            f"{of.own_s:.1f}",
            "unknown" if of.others is None else f"{of.others:.2f}",
        ]
        for workers, of in timings.items()
    ]
    header = ["workers", "time [s]", "runs/s", "times as fast", "processor time [s]", "cores others used"]
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
