"""Reading a CARMEN log, plain and gzipped, beside no more than turning its fields into numbers."""

import gzip

import numpy as np
import pytest

from drivers.carmen.log import CarmenLog

SCANS = 1000
BEAMS = 180

pytestmark = pytest.mark.benchmark(group=f"CARMEN log of {SCANS} scans, {BEAMS} beams")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    rng = np.random.default_rng(0)
    lines = []
    for k, ranges in enumerate(rng.uniform(0.5, 20.0, (SCANS, BEAMS))):
        odometry = f"{0.1 * k:.6f} 0.000000 0.000000"
        beams = " ".join(f"{each:.2f}" for each in ranges)
        lines.append(f"FLASER {BEAMS} {beams} {odometry} {odometry} {0.2 * k:.6f} host {0.2 * k:.6f}\n")
    text = "".join(lines).encode()
    folder = tmp_path_factory.mktemp("log")
    (folder / "run.clf").write_bytes(text)
    (folder / "run.clf.gz").write_bytes(gzip.compress(text))
    return folder / "run.clf"


def read(path):
    return sum(frame.scan is not None for frame in CarmenLog(path))


def convert(path):
    """Split the lines and convert the fields: what no reader can do without."""
    return sum(len(list(map(float, line.split()[2 : 2 + BEAMS]))) == BEAMS for line in path.read_bytes().splitlines())


def report_rate(benchmark):
    if benchmark.stats is not None:
        benchmark.extra_info["scans_per_second"] = round(SCANS / benchmark.stats.stats.median)


@pytest.mark.parametrize("suffix", [".clf", ".clf.gz"])
def test_read(benchmark, log, suffix):
    assert benchmark(read, log.with_suffix(suffix)) == SCANS
    report_rate(benchmark)


def test_convert_only(benchmark, log):
    assert benchmark(convert, log) == SCANS
    report_rate(benchmark)
