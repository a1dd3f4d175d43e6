"""One function per study: run it, write its files into a folder, return what to print."""

from pathlib import Path
from typing import Any

from slam.errors import RunFolderError
from slam.progress import RunProgress
from slam.study.consistency import ConsistencySettings, consistency_lines, consistency_rows, consistency_summary
from slam.study.corner_table import corner_rows, summarise, summary_lines
from slam.study.corners import CornerSettings, scan_corners
from slam.study.methods import METHODS
from slam.study.output import write_csv, write_json, write_settings
from slam.study.timing import TimingSettings, figure_3_rows, step_rows, timing_lines, uncertainty_rows


def study_corners(folder: Path, settings: CornerSettings) -> list[str]:
    """Write ``corners.csv``, ``summary.json``, ``corners.png`` and ``settings.toml``; return the summary's lines.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.study.plot import draw_corners

    with RunProgress(f"corners of {settings.environment}") as progress:
        seen, found = scan_corners(settings, progress.update)
    rows = corner_rows(seen, found)
    summary = summarise(settings, seen, found, rows)
    write_settings(folder, "corners", settings, {"extraction": METHODS[2].extraction})
    write_csv(folder / "corners.csv", rows)
    write_json(folder / "summary.json", summary)
    _draw(draw_corners, folder / "corners.png", summary, rows)
    return summary_lines(summary)


def study_consistency(folder: Path, settings: ConsistencySettings) -> list[str]:
    """Write ``consistency.csv``, ``summary.json``, ``consistency.png`` and ``settings.toml``; return what to print.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.study.plot import draw_consistency

    with RunProgress("consistency") as progress:
        rows = consistency_rows(settings, progress.update)
    summary = consistency_summary(rows)
    write_settings(folder, "consistency", settings)
    write_csv(folder / "consistency.csv", rows)
    write_json(folder / "summary.json", summary)
    _draw(draw_consistency, folder / "consistency.png", settings, rows)
    return consistency_lines(summary)


def study_timing(folder: Path, settings: TimingSettings) -> list[str]:
    """Write the data and the counterparts of Fig. 3, 4 and 5 and ``settings.toml``; return what to print.

    Raises
    ------
    RunFolderError
        A file cannot be written.
    """
    from slam.study.plot import draw_figure_3, draw_steps

    with RunProgress("timing") as progress:
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
