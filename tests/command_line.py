"""What a call of the command line leaves behind."""

from collections.abc import Callable
from typing import NamedTuple


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


Call = Callable[..., Outcome]
"""The command line, called with the words of a command."""
