"""Sends requests over a link and waits for their answers."""

import time
from collections.abc import Mapping

from drivers.errors import DriverError
from drivers.rplidar.protocol import requests
from drivers.rplidar.protocol.answer_search import AnswerSearch
from drivers.rplidar.protocol.answers import Answer, Conf, unpack_number
from drivers.rplidar.protocol.link import Link
from drivers.rplidar.protocol.requests import Command

ANSWER_TIMEOUT = 1.0
"""Longest wait for an answer; a request is sent twice [s]."""


class NoAnswerError(DriverError):
    """A request that was not answered in time."""


def search_answer(link: Link, request: bytes, search: AnswerSearch, timeout: float = ANSWER_TIMEOUT) -> bool:
    """Send a request, and return whether its answer arrived before the timeout [s]."""
    link.write(request)
    end = time.monotonic() + timeout
    while not search.feed(link.read()):
        if time.monotonic() > end:
            return False
    return True


def ask(link: Link, command: Command, answer: Answer, size: int) -> bytes:
    """Send a request without parameters and return the payload of its answer.

    Raises
    ------
    NoAnswerError
        The answer does not come.
    """
    return _ask(link, requests.request(command), {answer: size}, command.name)


def ask_conf(link: Link, kind: Conf, mode: int | None = None) -> bytes:
    """Request a value of the configuration, for a scan mode where there is one for each, and return the payload."""
    return _ask(link, requests.lidar_conf(kind, mode), {Answer.LIDAR_CONF: None}, f"GET_LIDAR_CONF {kind.name}")


def ask_number(link: Link, kind: Conf, mode: int | None = None) -> float:
    """Request a numeric value of the configuration."""
    return unpack_number(kind, ask_conf(link, kind, mode))


def _ask(link: Link, request: bytes, sizes: Mapping[Answer, int | None], name: str) -> bytes:
    for _ in range(2):
        search = AnswerSearch(sizes)
        if search_answer(link, request, search):
            return search.payload
    raise NoAnswerError(f"{link.port}: {name} is not answered: check cable and supply, then plug the scanner in anew")
