"""One function per study: run it, write its files into a folder, return what to print."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from distributed import Client

from slam.errors import RunFolderError, StudyError
from slam.run.progress_bar import ProgressBar
from slam.study.monte_carlo.bars import bars, bars_table
from slam.study.monte_carlo.runs import (
    MonteCarloSettings,
    consistency_table,
    monte_carlo_lines,
    monte_carlo_summary,
    monte_carlo_table,
    nees_rows,
    run_rows,
    run_task,
)
from slam.study.output import markdown_table, write_csv, write_json, write_settings, write_text
from slam.study.paper.consistency import (
    ConsistencySettings,
    consistency_lines,
    consistency_rows,
    consistency_summary,
    scene_task,
    scenes,
)
from slam.study.paper.corner_table import corner_rows, summarise, summary_lines
from slam.study.paper.corners import CornerSettings, gather, scan_task, task_count
from slam.study.paper.methods import METHODS
from slam.study.paper.timing import TimingSettings, figure_3_rows, step_rows, timing_lines, uncertainty_rows
from slam.study.tasks.run import FAILURES, Failure, Outcome, run_tasks


def study_corners(client: Client, folder: Path, settings: CornerSettings) -> list[str]:
    """Write ``corners.csv``, ``summary.json``, ``corners.png`` and ``settings.toml``; return the summary's lines.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    StudyError
        A task failed; the others are done.
    """
    from slam.study.paper.plot import draw_corners

    outcome = run_tasks(client, folder, "corners", settings, scan_task, task_count(settings))
    seen, found = gather(settings, _all_results(folder, outcome))
    rows = corner_rows(seen, found)
    summary = summarise(settings, seen, found, rows)
    write_settings(folder, "corners", settings, {"extraction": METHODS[2].extraction})
    write_csv(folder / "corners.csv", rows)
    write_json(folder / "summary.json", summary)
    _draw(draw_corners, folder / "corners.png", summary, rows)
    return summary_lines(summary)


def study_consistency(client: Client, folder: Path, settings: ConsistencySettings) -> list[str]:
    """Write ``consistency.csv``, ``summary.json``, ``consistency.png`` and ``settings.toml``; return what to print.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    StudyError
        A task failed; the others are done.
    """
    from slam.study.paper.plot import draw_consistency

    count = len(list(scenes(settings)))
    outcome = run_tasks(client, folder, "consistency", settings, scene_task, count)
    rows = consistency_rows(settings, _all_results(folder, outcome))
    summary = consistency_summary(rows)
    write_settings(folder, "consistency", settings)
    write_csv(folder / "consistency.csv", rows)
    write_json(folder / "summary.json", summary)
    _draw(draw_consistency, folder / "consistency.png", settings, rows)
    return consistency_lines(summary)


def study_slam(client: Client, folder: Path, settings: MonteCarloSettings) -> tuple[list[str], list[Failure]]:
    """Write ``runs.csv``, ``nees.csv``, ``summary.json``, ``slam.png``, ``page.md`` and ``settings.toml``.

    Runs that failed are named in the summary and in ``failures.txt``, and are in no table.

    Returns
    -------
    What to print, and the runs that failed.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    StudyError
        All runs failed.
    """
    from slam.study.monte_carlo.plot import draw_monte_carlo

    outcome = run_tasks(client, folder, "slam", settings, run_task, settings.seeds)
    if not outcome.results:
        raise StudyError(failed(folder, outcome.failures, settings.seeds))
    results = list(outcome.results.values())
    rows, traces = run_rows(results), nees_rows(results)
    summary = monte_carlo_summary(settings, results, outcome.failures)
    write_settings(folder, "slam", settings)
    write_csv(folder / "runs.csv", rows)
    write_csv(folder / "nees.csv", traces)
    write_json(folder / "summary.json", summary)
    _draw(draw_monte_carlo, folder / "slam.png", summary, rows, traces)
    lines = monte_carlo_lines(summary)
    cells = monte_carlo_table(summary), consistency_table(summary), bars_table(bars(summary))
    tables = (markdown_table(of[0], of[1:]) for of in cells)
    write_text(folder / "page.md", "\n\n".join([f"# {lines[0]}", *tables, "![Runs](slam.png)"]) + "\n")
    return lines, outcome.failures


def failed(folder: Path, failures: Sequence[Failure], count: int) -> str:
    """Say in one line that tasks failed, and what to do."""
    return (
        f"{len(failures)} of {count} tasks failed, see {folder / FAILURES}; the others are kept in {folder}: "
        "the same command tries the failed ones again"
    )


def _all_results(folder: Path, outcome: Outcome) -> list[Any]:
    if outcome.failures:
        raise StudyError(failed(folder, outcome.failures, len(outcome.results) + len(outcome.failures)))
    return list(outcome.results.values())


def study_timing(folder: Path, settings: TimingSettings) -> list[str]:
    """Write the data and the counterparts of Fig. 3, 4 and 5 and ``settings.toml``; return what to print.

    It measures time, so it stays in this process: workers beside it would slow each other.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.study.paper.plot import draw_figure_3, draw_steps

    with ProgressBar("timing") as progress:
        curve = figure_3_rows(settings, lambda share, count: progress.update(0.6 * share, count))
        steps = step_rows(settings)
        progress.update(0.8, len(curve) + len(steps))
        uncertainty = uncertainty_rows(settings)
    write_settings(folder, "timing", settings)
    write_csv(folder / "figure_3.csv", curve)
    write_csv(folder / "steps.csv", steps)
    write_csv(folder / "uncertainty.csv", uncertainty)
    write_json(folder / "summary.json", {"figure_3": curve, "steps": steps, "uncertainty": uncertainty})
    _draw(draw_figure_3, folder / "figure_3.png", curve)
    for number, environment in ((4, "A"), (5, "B")):
        _draw(draw_steps, folder / f"figure_{number}.png", environment, steps, uncertainty)
    return timing_lines(curve, steps, uncertainty)


def _draw(draw: Any, path: Path, *arguments: Any) -> None:
    try:
        draw(path, *arguments)
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be written: {error.strerror or error}") from None
