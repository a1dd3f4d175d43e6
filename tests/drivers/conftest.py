import gzip
from collections.abc import Callable
from pathlib import Path

import pytest
from places import DATA


@pytest.fixture
def intel_log() -> Path:
    path = DATA / "intel-lab.clf.gz"
    if not path.is_file():
        pytest.skip(f"{path} is absent: set CWLF_DATA to the folder of the real logs")
    return path


@pytest.fixture
def two_lidars() -> Path:
    path = DATA / "two-lidars.bag"
    if not path.is_file():
        pytest.skip(f"{path} is absent: set CWLF_DATA to the folder of the real logs")
    return path


@pytest.fixture
def write_log(tmp_path: Path) -> Callable[..., Path]:
    """Write lines or bytes to a log, gzipped on demand, and return its path."""

    def write(*lines: str | bytes, name: str = "run.clf", compress: bool = False, end: bytes = b"\n") -> Path:
        text = b"\n".join(line.encode() if isinstance(line, str) else line for line in lines) + end
        path = tmp_path / name
        path.write_bytes(gzip.compress(text) if compress else text)
        return path

    return write
