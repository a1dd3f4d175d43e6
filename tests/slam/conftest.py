"""What the tests of studies and of the command line share."""

import sys
from collections.abc import Iterator

import pytest
from command_line import Call, Outcome
from distributed import Client, LocalCluster

from slam.cli.main import main


@pytest.fixture
def cwlf(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Call:
    def call(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["cwlf-slam", *map(str, arguments)])
        with pytest.raises(SystemExit) as leaving:
            main()
        captured = capfd.readouterr()
        return Outcome(int(leaving.value.code or 0), captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def client() -> Iterator[Client]:
    """Two workers inside this process, which start at once, with a scheduler that has an address."""
    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
        ) as cluster,
        Client(cluster) as connected,
    ):
        yield connected
