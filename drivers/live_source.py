"""What a live scanner is: a source of frames that is started and closed, and how one is found and opened."""

from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self

from drivers.counts import Counts
from drivers.errors import DriverError
from drivers.frame import FrameSource
from features.scan import LaserScan


class RawStream(Protocol):
    """Parameters of a scan that are needed to decode its bytes."""

    def to_record(self) -> dict[str, Any]:
        """Parameters as a JSON object; ``scanner`` in it is the name of the scanner's kind, ``rplidar`` by default."""
        ...


class RawTap(Protocol):
    """Receives every byte of a live scanner, in the thread that reads them."""

    def begin(self, stream: RawStream, time: float) -> None:
        """Receive the parameters of a scan that starts at a time [s since 1970]; its bytes follow."""
        ...

    def chunk(self, data: bytes, time: float) -> None:
        """Receive bytes that arrived at a time [s since 1970]."""
        ...


class RawDecoder(Protocol):
    """Decodes the bytes of one scan into revolutions."""

    @property
    def counts(self) -> Counts:
        """What became of the bytes so far."""
        ...

    def feed(self, data: bytes, time: float) -> list[LaserScan]:
        """Return the revolutions that are complete with bytes that arrived at a time [s since 1970]."""
        ...


class LiveSource(FrameSource, Protocol):
    """A scanner as a source of frames; a context manager that opens and closes it.

    Inside the context the scanner is known, so ``info`` is, and it is at rest until :meth:`start`. Iterating yields one
    frame for each revolution, until the source is closed. Losses of the connection are the source's own business.
    """

    @property
    @abstractmethod
    def counts(self) -> Counts:
        """What was received and lost so far."""
        ...

    @abstractmethod
    def start(self, tap: RawTap | None = None) -> None:
        """Start the scan; a scanner whose bytes can be recorded passes them to ``tap``.

        Raises
        ------
        DriverError
            The scanner does not start.
        """
        ...

    @abstractmethod
    def close(self) -> None:
        """Stop the scan; revolutions that were not taken yet can still be taken. May be called twice."""
        ...

    @abstractmethod
    def __enter__(self) -> Self:
        """Open the scanner; raises :class:`DriverError` where there is none or it cannot be used."""
        ...

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...

    @property
    def progress(self) -> float:
        """Zero: a live source has no end."""
        return 0.0


@dataclass(frozen=True, slots=True)
class LiveOptions:
    """What a user asks of a live scanner.

    Parameters
    ----------
    port : where it is connected; None for the first port at which one answers.
    mode : name of the scan mode; None for the scanner's default.
    rpm : rotation rate [1/min]; None for the scanner's default.
    baud : speed of a serial link [bit/s]; None to detect it.
    capacity : revolutions that are kept until they are taken; one more drops the oldest.
    """

    port: str | None = None
    mode: str | None = None
    rpm: int | None = None
    baud: int | None = None
    capacity: int = 10


@dataclass(frozen=True, slots=True)
class Scanner:
    """What the command line needs of a kind of scanner.

    Parameters
    ----------
    connect : makes the source, which is not opened yet; raises :class:`DriverError` for an option that this kind does
        not have.
    discover : searches the given ports, or all ports of this computer where none is given, and yields for each port
        the description of the scanner, or the reason why there is none.
    decoder : makes the decoder of a scan from the record of its :class:`RawStream`, and raises :class:`KeyError`,
        :class:`TypeError` or :class:`ValueError` for an unusable one; None where the bytes are not recorded.
    """

    connect: Callable[[LiveOptions], LiveSource]
    discover: Callable[[Sequence[str]], Iterator[str | DriverError]]
    decoder: Callable[[Mapping[str, Any]], RawDecoder] | None = None
