"""Connects to the scanner on a serial port: stops a running scan and detects the speed of the link."""

from threading import Event

from drivers.errors import DriverError
from drivers.rplidar.protocol import requests
from drivers.rplidar.protocol.answer_search import AnswerSearch
from drivers.rplidar.protocol.answers import Answer, DeviceInfo
from drivers.rplidar.protocol.link import Link
from drivers.rplidar.protocol.request_reply import search_answer
from drivers.rplidar.protocol.requests import Command

BAUDS = (115200, 256000, 460800, 1000000)
"""Speeds of the known models, in the order in which they are tried."""

ROUNDS = 2
"""How often all speeds are tried: a scanner that has just been plugged in does not answer at once."""

PROBE_TIMEOUT = 0.4
"""Longest wait for an answer at a speed that may be wrong [s]."""

QUIET = 0.08
"""Silence after which a scan counts as stopped [s]."""

DRAIN_LIMIT = 0.5
"""Longest wait for that silence [s]."""

YDLIDAR_HEADER = b"\xaa\x55"
YDLIDAR_HEADERS = 5
"""Number of headers from which the device is taken for a YDLIDAR; in random bytes one in 65536 pairs is a header."""


def connect(port: str, closing: Event, baud: int | None = None) -> tuple[Link, DeviceInfo]:
    """Open a port, stop a scan that may be running, and detect the speed at which the scanner answers.

    Parameters
    ----------
    port : name of the port.
    closing : set to give up at once.
    baud : speed [bit/s], where it is known; else those of :data:`BAUDS` are tried.

    Raises
    ------
    DriverError
        The port cannot be opened, no scanner answers, or the device is of another maker.
    """
    bauds = BAUDS if baud is None else (baud,)
    link = Link(port, closing)
    foreign = 0
    try:
        for each in bauds * ROUNDS:
            link.baud = each
            link.write(requests.request(Command.STOP))
            foreign += link.drain(QUIET, DRAIN_LIMIT).count(YDLIDAR_HEADER)
            search = identify(link)
            foreign += search.skipped.count(YDLIDAR_HEADER)
            if search.descriptor is not None:
                return link, DeviceInfo.unpack(search.payload)
        if foreign >= YDLIDAR_HEADERS:
            raise DriverError(f"{port}: its packets begin with AA 55: this is a YDLIDAR, which needs its own driver")
        raise DriverError(
            f"{port}: no RPLIDAR answers at {', '.join(map(str, bauds))} baud: check that the scanner has power, "
            "and that this is its port"
        )
    except BaseException:
        link.close()
        raise


def identify(link: Link) -> AnswerSearch:
    """Request model and serial number; the search has no descriptor where no scanner answers."""
    search = AnswerSearch({Answer.INFO: 20})
    search_answer(link, requests.request(Command.GET_INFO), search, PROBE_TIMEOUT)
    return search
