"""Run SLAM on real logs and fill the table of README.md: python docs/measure_logs.py FOLDER; `make results`.

The logs are in the folder CWLF_DATA (default ../shared/data); the run folders go into the folder given.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from slam.study.output import markdown_table
from slam.study.page import fill

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("CWLF_DATA", ROOT / ".." / "shared" / "data"))
HEADER = ["log", "measured", "at the end", "as it was live", "data", "computed in", "memory"]


def main() -> None:
    """Measure every log and put the table in its place."""
    folder = Path(sys.argv[1])
    intel, relations = DATA / "intel-lab.clf.gz", DATA / "intel-lab.relations"
    csail, reference = DATA / "mit-csail.clf.gz", DATA / "mit-csail-reference.txt"
    mrclam = DATA / "mrclam6"
    rows = [
        row("Intel Research Lab", "relations, mean", folder / "intel", [intel], ["--relations", relations]),
        row("Intel, every 5th scan", "same", folder / "intel-5", [intel, "--every", 5], ["--relations", relations]),
        row("MIT CSAIL", "ATE", folder / "csail", [csail], ["--truth", reference]),
        row("MRCLAM 6, robot 3", "landmarks, RMS", folder / "mrclam", [mrclam], ["--truth", mrclam]),
        row(
            "the same without identities",
            "landmarks, RMS",
            folder / "mrclam-withheld",
            [mrclam, "--ignore-identities"],
            ["--truth", mrclam],
        ),
    ]
    page = ROOT / "README.md"
    page.write_text(fill(page.read_text(encoding="utf-8"), {"logs": markdown_table(HEADER, rows)}), encoding="utf-8")


def row(name: str, measured: str, run: Path, log: list[object], truth: list[object]) -> list[str]:
    """Run a log and evaluate it; cells of its row."""
    command("run", *log, "--out", run, "--overwrite")
    final, online = (
        error(json.loads(command("evaluate", run, *truth, "--trajectory", which, "--json")))
        for which in ("final", "online")
    )
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    took = f"{metrics['wall_s']:.0f} s ({metrics['times_real_time']:.0f} x)"
    live = "" if measured.startswith("landmarks") else online
    return [name, measured, final, live, f"{metrics['duration_s']:,.0f} s", took, f"{metrics['peak_memory_mb']:.0f} MB"]


def error(report: dict[str, dict[str, float]]) -> str:
    """Figure that counts in a report of `evaluate --json`."""
    if "relations" in report:
        of = report["relations"]
        return f"{of['translation_mean_m']:.3f} m, {of['rotation_mean_deg']:.2f} deg"
    return f"{report['landmarks' if 'landmarks' in report else 'ate']['rmse_m']:.3f} m"


def command(*arguments: object) -> str:
    """Run a command of cwlf-slam; what it says."""
    said = subprocess.run([sys.executable, "-m", "slam.cli", *map(str, arguments)], check=True, stdout=subprocess.PIPE)
    return said.stdout.decode()


main()
