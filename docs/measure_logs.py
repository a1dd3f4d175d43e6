"""Run SLAM on real logs and fill the table of README.md: python docs/measure_logs.py FOLDER; `make results`.

The logs are in the folder CWLF_DATA (default ../shared/data); what is made of them on the way goes into the folder
given.
"""

import gzip
import json
import os
import subprocess
import sys
from pathlib import Path

from slam.study.output import fill, markdown_table

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("CWLF_DATA", ROOT / ".." / "shared" / "data"))
HEADER = ["log", "measured", "in the end", "as it was live", "log lasts", "computed in", "memory"]
RELATIONS, ATE, SURVEY = "relations, mean", "ATE", "landmarks, RMS"


def main() -> None:
    """Measure every log and put the table in its place."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    intel, relations = DATA / "intel-lab.clf.gz", DATA / "intel-lab.relations"
    csail, reference = DATA / "mit-csail.clf.gz", DATA / "mit-csail-reference.txt"
    intel_back, relations_back = backwards(folder, intel, relations, stamps=2)
    csail_back, reference_back = backwards(folder, csail, reference, stamps=1)
    mrclam = DATA / "mrclam6"
    rows = [
        row(folder, "Intel Research Lab", RELATIONS, relations, intel),
        row(folder, "every 5th of its scans", RELATIONS, relations, intel, "--every", 5),
        row(folder, "the log backwards in time", RELATIONS, relations_back, intel_back),
        row(folder, "MIT CSAIL", ATE, reference, csail),
        row(folder, "that log backwards", ATE, reference_back, csail_back),
        row(folder, "MRCLAM 6, robot 3", SURVEY, mrclam, mrclam),
        row(folder, "the same without identities", SURVEY, mrclam, mrclam, "--ignore-identities"),
    ]
    page = ROOT / "README.md"
    page.write_text(fill(page.read_text(encoding="utf-8"), {"logs": markdown_table(HEADER, rows)}), encoding="utf-8")


def backwards(folder: Path, log: Path, truth: Path, stamps: int) -> tuple[Path, Path]:
    """Turn a CARMEN log and its truth, whose lines begin with so many stamps, round in time."""
    with gzip.open(log, "rt", encoding="utf-8") as file:
        lines = list(file)
    records = [line.split() for line in lines if line.startswith(("FLASER", "ODOM"))]
    records.sort(key=lambda fields: float(fields[-3]))
    both_ends = float(records[0][-3]) + float(records[-1][-3])
    log_back, truth_back = folder / f"{log.stem}-backwards.gz", folder / f"{truth.stem}-backwards.txt"
    with gzip.open(log_back, "wt", encoding="utf-8") as file:
        file.writelines(line for line in lines if line.startswith("PARAM"))
        for fields in reversed(records):
            fields[-3] = f"{both_ends - float(fields[-3]):.6f}"
            file.write(" ".join(fields) + "\n")
    rows = [line.split() for line in truth.read_text(encoding="utf-8").splitlines() if line[:1].isdigit()]
    turned = [[f"{both_ends - float(stamp):.6f}" for stamp in fields[:stamps]] + fields[stamps:] for fields in rows]
    turned.sort(key=lambda fields: float(fields[0]))
    truth_back.write_text("".join(" ".join(fields) + "\n" for fields in turned), encoding="utf-8")
    return log_back, truth_back


def row(folder: Path, name: str, measured: str, truth: Path, log: Path, *options: object) -> list[str]:
    """Run a log and evaluate it; cells of its row."""
    run = folder / name.replace(" ", "-").replace(",", "")
    command("run", log, *options, "--out", run, "--overwrite")
    final, online = (
        error(measured, json.loads(command("evaluate", run, against, truth, "--trajectory", which, "--json")))
        for against in ("--relations" if measured == RELATIONS else "--truth",)
        for which in ("final", "online")
    )
    metrics = json.loads((run / "metrics.json").read_text(encoding="utf-8"))
    took = f"{metrics['wall_s']:.0f} s ({metrics['times_real_time']:.0f} x)"
    lasts, memory = f"{metrics['duration_s']:,.0f} s", f"{metrics['peak_memory_mb']:.0f} MB"
    return [name, measured, final, "" if measured == SURVEY else online, lasts, took, memory]


def error(measured: str, report: dict[str, dict[str, float]]) -> str:
    """Figure that counts in a report of `evaluate --json`."""
    if measured == RELATIONS:
        of = report["relations"]
        return f"{of['translation_mean_m']:.3f} m, {of['rotation_mean_deg']:.2f} deg"
    return f"{report['landmarks' if measured == SURVEY else 'ate']['rmse_m']:.3f} m"


def command(*arguments: object) -> str:
    """Run a command of cwlf-slam; what it says."""
    said = subprocess.run(
        [sys.executable, "-m", "slam.cli.main", *map(str, arguments)], check=True, stdout=subprocess.PIPE
    )
    return said.stdout.decode()


main()
