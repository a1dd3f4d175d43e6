"""The page of the speed-up: its arithmetic, and what it tells of the rounds."""

from contextlib import nullcontext
from pathlib import Path

import pytest
from distributed import Client
from hypothesis import given
from hypothesis import strategies as st

from slam.study.monte_carlo import scaling
from slam.study.monte_carlo.scaling import Costs, Round, make_scaling_page, nothing


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
def page(client: Client, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A page to fill; workers are threads of this process, and all else is as small as can be."""
    monkeypatch.setattr(scaling, "pool", lambda **_: nullcontext(client))
    monkeypatch.setattr(scaling, "EMPTY_TASKS", 3)
    monkeypatch.setattr(scaling, "_command_s", lambda _: 5.0)
    path = tmp_path / "scaling.md"
    path.write_text("".join(f"<!-- {name} -->\n<!-- end -->\n" for name in ("measured", "costs", "beyond")))
    return path


@pytest.mark.slow
def test_the_page_tells_the_rounds_at_rest_beside_all(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rounds = [Round(0.5, 0.9, 0.05), Round(0.5, 1.0, 0.0), Round(0.5, 0.95, 0.09), Round(0.2, 0.1, 1.0)]
    monkeypatch.setattr(scaling, "_rounds", lambda *_: rounds)
    monkeypatch.setattr(scaling.os, "cpu_count", lambda: 2)
    lines = make_scaling_page(page.parent, page.parent / "runs", 4)
    assert lines[0] == "2 workers are 1.90 times as fast as one: median of 3 rounds at rest"
    text = page.read_text()
    assert "| machine at rest | 3 | 0.500 | 0.950 | 1.90 | 1.80 .. 2.00 |" in text
    assert "| all | 4 | 0.500 | 0.925 | 1.85 | 0.50 .. 2.00 |" in text
    assert "| one run through the room, on one worker | 2.00 s |" in text
    assert "| serial: start, workers, tables, pictures | 5.0 s |" in text


def test_rounds_are_counted_and_leave_nothing_behind(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scaling, "run_task", nothing)
    rounds = scaling._rounds(page.parent, 2, 3)
    assert len(rounds) == 3
    assert all(of.one > 0.0 and of.every > 0.0 for of in rounds)
    assert [path.name for path in page.parent.iterdir()] == [page.name]
