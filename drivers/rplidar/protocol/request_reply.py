"""Requests and their answers over a link."""

import time
from collections.abc import Mapping

from drivers.errors import DriverError
from drivers.rplidar.protocol import requests
from drivers.rplidar.protocol.answer_search import AnswerSearch
from drivers.rplidar.protocol.answers import Answer, Conf, unpack_number
from drivers.rplidar.protocol.link import Link
from drivers.rplidar.protocol.requests import Command

ANSWER_TIMEOUT = 1.0
"""For an answer; it is asked for twice [s]."""


class NoAnswerError(DriverError):
    """A request that was not answered in time."""


def search_answer(link: Link, request: bytes, search: AnswerSearch, timeout: float = ANSWER_TIMEOUT) -> bool:
    """Send a request, and say whether its answer came in time [s]."""
    link.write(request)
    end = time.monotonic() + timeout
    while not search.feed(link.read()):
        if time.monotonic() > end:
            return False
    return True


def ask(link: Link, command: Command, answer: Answer, size: int) -> bytes:
    """Payload of the answer to a request without values.

    Raises
    ------
    NoAnswerError
        There is none.
    """
    return _exchange(link, requests.request(command), {answer: size}, command.name)


def ask_conf(link: Link, kind: Conf, mode: int | None = None) -> bytes:
    """Payload of the answer for a value of the configuration, of a scan mode where it has one per mode."""
    return _exchange(link, requests.lidar_conf(kind, mode), {Answer.LIDAR_CONF: None}, f"GET_LIDAR_CONF {kind.name}")


def ask_number(link: Link, kind: Conf, mode: int | None = None) -> float:
    """Value of the configuration."""
    return unpack_number(kind, ask_conf(link, kind, mode))


def _exchange(link: Link, request: bytes, sizes: Mapping[Answer, int | None], name: str) -> bytes:
    for _ in range(2):
        search = AnswerSearch(sizes)
        if search_answer(link, request, search):
            return search.payload
    raise NoAnswerError(f"{link.port}: {name} is not answered: check cable and supply, then plug the scanner in anew")
