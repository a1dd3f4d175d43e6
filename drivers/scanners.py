"""The kinds of scanners that the command line knows; the module of each is imported when it is used."""

from importlib import import_module

from drivers.errors import DriverError
from drivers.live_source import Scanner

SCANNERS = {
    "rplidar": "drivers.rplidar.scanner",
}
"""Module of each kind by the name that ``--scanner`` takes; its ``SCANNER`` is a :class:`Scanner`."""


def find_scanner(name: str) -> Scanner:
    """Import the kind of scanner of a name.

    Raises
    ------
    DriverError
        There is none.
    """
    if name not in SCANNERS:
        raise DriverError(f"no scanner is called {name!r}: choose {', '.join(sorted(SCANNERS))}")
    return import_module(SCANNERS[name]).SCANNER
