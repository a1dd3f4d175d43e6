"""The tables and pictures of docs/paper.md, made anew from the studies."""

import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from distributed import Client
from pydantic import BaseModel

from slam.errors import RunFolderError
from slam.study.output import fill, markdown_table
from slam.study.paper.consistency import ConsistencySettings
from slam.study.paper.corner_table import LABELS
from slam.study.paper.corners import CornerSettings
from slam.study.paper.report import study_consistency, study_corners, study_timing
from slam.study.paper.timing import FORMS, STEPS, TimingSettings
from slam.study.tasks.folder import study_folder
from slam.study.tasks.journal import JOURNAL, identity
from slam.study.tasks.run import pool

SIGMAS_MM = 10.0, 20.0, 50.0
PICTURES = {
    "corners-A-50/corners.png": "environment-a.png",
    "corners-B-50/corners.png": "environment-b.png",
    "consistency/consistency.png": "consistency.png",
    "timing/figure_3.png": "figure-3.png",
    "timing/figure_4.png": "figure-4.png",
    "timing/figure_5.png": "figure-5.png",
}


def make_page(docs: Path, runs: Path, scheduler: str | None = None, workers: int | None = None) -> list[str]:
    """Run every study into a folder below ``runs``, then fill the tables of ``docs/paper.md`` and its pictures.

    Parameters
    ----------
    docs, runs : folders.
    scheduler, workers : see :func:`slam.study.tasks.run.pool`; times are measured in this process, with no worker
        beside.

    Raises
    ------
    RunFolderError
        A file cannot be read or written, or the page has no place for a table.
    StudyError
        A task failed, or the scheduler is lost.
    """
    try:
        with pool(scheduler, workers) as client:
            blocks = {
                f"corners-{environment}": _corner_table(client, runs, environment)
                for environment in ("A", "B", "random")
            }
            settings = ConsistencySettings()
            with _folder(runs / "consistency", "consistency", settings) as folder:
                study_consistency(client, folder, settings)
        (runs / "timing").mkdir(parents=True, exist_ok=True)
        study_timing(runs / "timing", TimingSettings())
        summary = json.loads((runs / "timing" / "summary.json").read_text(encoding="utf-8"))
        blocks |= {"figure-3": _figure_3(summary["figure_3"]), "steps": _steps(summary["steps"])}
        blocks["uncertainty"] = _uncertainty(summary["uncertainty"])
        page = docs / "paper.md"
        page.write_text(fill(page.read_text(encoding="utf-8"), blocks), encoding="utf-8")
        (docs / "paper").mkdir(exist_ok=True)
        for source, target in PICTURES.items():
            shutil.copyfile(runs / source, docs / "paper" / target)
        for journal in runs.glob(f"*/{JOURNAL}"):
            journal.unlink()
    except OSError as error:
        raise RunFolderError(f"{error.filename}: {error.strerror}") from None
    return [f"filled {page}, {len(PICTURES)} pictures in {docs / 'paper'}"]


def _folder(path: Path, study: str, settings: BaseModel) -> AbstractContextManager[Path]:
    return study_folder(study, identity(study, settings), path, overwrite=True)


def _corner_table(client: Client, runs: Path, environment: Any) -> str:
    rows: list[list[str]] = []
    for sigma in SIGMAS_MM:
        settings = CornerSettings(environment=environment, sigma_range_mm=sigma)
        with _folder(runs / f"corners-{environment}-{sigma:g}", "corners", settings) as folder:
            study_corners(client, folder, settings)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        for key, of in summary["methods"].items():
            means, pooled, paper = of["table"], of["pooled"], of["paper_sigma_mm"]
            rows.append(
                [
                    f"{sigma:g}",
                    LABELS[key],
                    f"{paper[0]:.2f} / {paper[1]:.2f}" if paper and sigma == SIGMAS_MM[-1] else "",
                    f"{means['sigma_x_mm']:.2f} / {means['sigma_y_mm']:.2f}",
                    f"{means['rms_x_mm']:.2f} / {means['rms_y_mm']:.2f}",
                    f"{pooled['nees_half']:.2f}",
                    f"{pooled['outside_99']:.1%}",
                    f"{of['detected_clear']:.1%}",
                ]
            )
    header = ["sigma_range", "method", "paper claims", "claims", "errs (RMS)", "NEES/2", "outside 99 %", "found"]
    return markdown_table(header, rows)


def _figure_3(rows: Sequence[Mapping[str, Any]]) -> str:
    shown = [row for row in rows if row["measurements"] in {10, 50, 90, 100, 200, 1000}]
    header = ["measurements", *(f"{label} [us]" for label, _ in FORMS.values()), "ratio", "ratio, as printed"]
    names = (*(f"{form.replace('-', '_')}_us" for form in FORMS), "ratio_single_sums", "ratio_as_printed")
    return markdown_table(
        header, [[str(row["measurements"]), *(f"{row[name]:.3g}" for name in names)] for row in shown]
    )


def _steps(rows: Sequence[Mapping[str, Any]]) -> str:
    taken = {(row["environment"], row["measurements"], row["form"], row["step"]): row for row in rows}
    lines: list[list[str]] = []
    for environment, count, form in dict.fromkeys(key[:3] for key in taken):
        of = [taken[environment, count, form, step] for step in STEPS]
        shares = [f"{row['time_us']:.2f} ({row['share']:.0%})" for row in of]
        lines.append([environment, str(count), FORMS[form][0], *shares])
    return markdown_table(["environment", "points", "method", *(f"{step} [us]" for step in STEPS)], lines)


def _uncertainty(rows: Sequence[Mapping[str, Any]]) -> str:
    lines = [
        [
            row["environment"],
            str(row["measurements"]),
            LABELS[row["method"]],
            f"{row['sigma_x_mm']:.1f} / {row['sigma_y_mm']:.1f}",
            f"{row['rms_x_mm']:.1f} / {row['rms_y_mm']:.1f}",
            f"{row['nees_half']:.2f}",
        ]
        for row in rows
    ]
    return markdown_table(["environment", "points", "method", "claims x / y [mm]", "errs x / y [mm]", "NEES/2"], lines)
