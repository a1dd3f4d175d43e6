"""The study of trust: run it, write its files into a folder, return what to print."""

from pathlib import Path

from distributed import Client

from slam.errors import StudyError
from slam.study.output import markdown_table, write_csv, write_json, write_settings, write_text
from slam.study.tasks.run import Failure, failure_message, run_tasks
from slam.study.trust.runs import TrustSettings, run_rows, run_task, trust_summary, trust_tables


def study_trust(client: Client, folder: Path, settings: TrustSettings) -> tuple[list[str], list[Failure]]:
    """Write ``runs.csv``, ``summary.json``, ``page.md`` and ``settings.toml``.

    Runs that failed are named in ``failures.txt``, and are in no table.

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
    count = settings.runs + settings.faulty
    outcome = run_tasks(client, folder, "trust", settings, run_task, count)
    if not outcome.results:
        raise StudyError(failure_message(folder, outcome.failures, count))
    results = list(outcome.results.values())
    summary = trust_summary(results)
    write_settings(folder, "trust", settings)
    write_csv(folder / "runs.csv", run_rows(results))
    write_json(folder / "summary.json", summary)
    tables = trust_tables(summary)
    title = f"{settings.runs} runs without and {settings.faulty} with a fault, {len(outcome.failures)} failed"
    write_text(
        folder / "page.md", "\n\n".join([f"# {title}", *(markdown_table(of[0], of[1:]) for of in tables)]) + "\n"
    )
    lines = [title]
    for cells in tables:
        lines += [f"{row[0]:<26}" + "".join(f"{cell:>19}" for cell in row[1:]) for row in cells]
    return lines, outcome.failures
