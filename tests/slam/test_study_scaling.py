"""The page of the speed-up: its arithmetic, and that it compares what was written."""

from contextlib import nullcontext
from pathlib import Path

import pytest
from distributed import Client
from hypothesis import given
from hypothesis import strategies as st

from slam.errors import StudyError
from slam.study import scaling
from slam.study.scaling import COMPARED, Costs, Timing, make_scaling_page

PAGE = "".join(f"<!-- {name} -->\n<!-- end -->\n" for name in ("measured", "costs", "beyond"))


@given(
    st.floats(0.0, 100.0),
    st.floats(0.01, 100.0),
    st.floats(0.0, 0.01),
    st.integers(1, 10_000),
    st.integers(1, 1000),
)
def test_speed_up_is_bounded_by_workers_tasks_and_serial_part(
    serial_s: float, task_s: float, overhead_s: float, tasks: int, workers: int
) -> None:
    costs = Costs(serial_s, task_s, overhead_s, 1000.0)
    speed_up = costs.speed_up(tasks, workers)
    assert 1.0 <= speed_up <= min(workers, tasks) * (1.0 + 1e-9)
    assert costs.wall_s(tasks, workers) >= serial_s + task_s
    assert costs.speed_up(tasks, workers + 1) >= speed_up


def test_amdahl_without_overhead() -> None:
    """A serial part of a tenth of the time on one worker lets five workers be 1 / (0.1 + 0.9 / 5) times as fast."""
    assert Costs(10.0, 0.9, 0.0, 0.0).speed_up(100, 5) == pytest.approx(1.0 / (0.1 + 0.9 / 5.0))


@pytest.fixture
def timed(client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Studies that are not run but said to take a second and 10 s, 20 s in all with one worker."""

    def study(folder: Path, *options: str) -> Timing:
        folder.mkdir()
        for name in COMPARED:
            (folder / name).write_text("the same")
        return {"serial": Timing(1.0, 1.0, 0.0), "workers-1": Timing(21.0, 20.0, 0.1)}.get(
            folder.name, Timing(11.0, 20.0, None)
        )

    monkeypatch.setattr(scaling.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(scaling, "_timed", study)
    monkeypatch.setattr(scaling, "pool", lambda **_: nullcontext(client))
    monkeypatch.setattr(scaling, "EMPTY_TASKS", 3)
    (tmp_path / "scaling.md").write_text(PAGE)
    return tmp_path


def test_the_page_has_what_was_measured(timed: Path) -> None:
    lines = make_scaling_page(timed, timed / "runs", seeds=10)
    assert lines[0] == "10 runs: 21 s on one worker, 11 s on 2: 1.91 times as fast, the same files"
    page = (timed / "scaling.md").read_text()
    assert "| 1 | 21.0 | 0.48 | 1.00 | 20.0 | 0.10 |" in page
    assert "| 2 | 11.0 | 0.91 | 1.91 | 20.0 | unknown |" in page
    assert "| one run through the room, on one worker | 2.00 s |" in page


def test_files_that_differ_are_an_error(timed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study = scaling._timed

    def other(folder: Path, *options: str) -> Timing:
        timing = study(folder, *options)
        (folder / COMPARED[0]).write_text(folder.name)
        return timing

    monkeypatch.setattr(scaling, "_timed", other)
    with pytest.raises(StudyError, match="differs between one worker and 2"):
        make_scaling_page(timed, timed / "runs", seeds=10)
