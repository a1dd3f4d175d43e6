"""The study of the whole pipeline: run it, write its files into a folder, return what to print."""

from pathlib import Path

from distributed import Client

from slam.errors import StudyError
from slam.study.monte_carlo.runs import (
    MonteCarloSettings,
    monte_carlo_lines,
    monte_carlo_summary,
    nees_rows,
    run_rows,
    run_task,
    summary_tables,
)
from slam.study.output import markdown_table, write_csv, write_json, write_picture, write_settings, write_text
from slam.study.tasks.run import Failure, failure_message, run_tasks


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
    from slam.pictures.monte_carlo import draw_monte_carlo

    outcome = run_tasks(client, folder, "slam", settings, run_task, settings.seeds)
    if not outcome.results:
        raise StudyError(failure_message(folder, outcome.failures, settings.seeds))
    results = list(outcome.results.values())
    rows, traces = run_rows(results), nees_rows(results)
    summary = monte_carlo_summary(settings, results, outcome.failures)
    write_settings(folder, "slam", settings)
    write_csv(folder / "runs.csv", rows)
    write_csv(folder / "nees.csv", traces)
    write_json(folder / "summary.json", summary)
    write_picture(draw_monte_carlo, folder / "slam.png", summary, rows, traces)
    lines = monte_carlo_lines(summary)
    tables = (markdown_table(of[0], of[1:]) for of in summary_tables(summary))
    write_text(folder / "page.md", "\n\n".join([f"# {lines[0]}", *tables, "![Runs](slam.png)"]) + "\n")
    return lines, outcome.failures
