"""The studies of the paper, a function each: run it, write its files into a folder, return what to print."""

from pathlib import Path

from distributed import Client

from slam.run.progress_bar import ProgressBar
from slam.study.output import write_csv, write_json, write_picture, write_settings
from slam.study.paper.consistency import (
    SWEEPS,
    ConsistencySettings,
    consistency_lines,
    consistency_rows,
    consistency_summary,
    scene_task,
    scenes,
)
from slam.study.paper.corner_table import LABELS, corner_rows, summarise, summary_lines
from slam.study.paper.corners import CornerSettings, collect_results, scan_task, task_count
from slam.study.paper.methods import METHODS
from slam.study.paper.timing import FORMS, TimingSettings, figure_3_rows, step_rows, timing_lines, uncertainty_rows
from slam.study.tasks.run import all_results, run_tasks


def study_corners(client: Client, folder: Path, settings: CornerSettings) -> list[str]:
    """Write ``corners.csv``, ``summary.json``, ``corners.png`` and ``settings.toml``; return the summary's lines.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    StudyError
        A task failed; the others are done.
    """
    from slam.pictures.paper_studies import draw_corners

    outcome = run_tasks(client, folder, "corners", settings, scan_task, task_count(settings))
    seen, found, clear_found = collect_results(settings, all_results(folder, outcome))
    rows = corner_rows(seen, found)
    summary = summarise(settings, seen, found, clear_found, rows)
    write_settings(folder, "corners", settings, {"extraction": METHODS[2].extraction})
    write_csv(folder / "corners.csv", rows)
    write_json(folder / "summary.json", summary)
    write_picture(draw_corners, folder / "corners.png", summary, rows, LABELS)
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
    from slam.pictures.paper_studies import draw_consistency

    count = len(list(scenes(settings)))
    outcome = run_tasks(client, folder, "consistency", settings, scene_task, count)
    rows = consistency_rows(settings, all_results(folder, outcome))
    summary = consistency_summary(rows)
    write_settings(folder, "consistency", settings)
    write_csv(folder / "consistency.csv", rows)
    write_json(folder / "summary.json", summary)
    subtitle = (
        f"corner of {settings.corner_angle_deg:g} deg, {settings.distance_m:g} m away, walls of "
        f"{settings.wall_m:g} m at {settings.incidence_deg:g} deg to the line of sight, sigma_range "
        f"{settings.sigma_range_mm:g} mm, sigma_bearing {settings.sigma_bearing_deg:.3f} deg; "
        f"each panel changes one of them, {settings.trials} trials each"
    )
    sweeps = {name: label for name, (label, _) in SWEEPS.items()}
    write_picture(draw_consistency, folder / "consistency.png", subtitle, rows, sweeps, LABELS)
    return consistency_lines(summary)


def study_timing(folder: Path, settings: TimingSettings) -> list[str]:
    """Write the data and the counterparts of Fig. 3, 4 and 5 and ``settings.toml``; return what to print.

    It measures time, so it stays in this process: workers beside it would slow each other.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.pictures.paper_studies import draw_figure_3, draw_steps

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
    write_picture(draw_figure_3, folder / "figure_3.png", curve, {form: label for form, (label, _) in FORMS.items()})
    for number, environment in ((4, "A"), (5, "B")):
        write_picture(draw_steps, folder / f"figure_{number}.png", environment, steps, uncertainty, LABELS)
    return timing_lines(curve, steps, uncertainty)
