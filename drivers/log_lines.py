"""Reads the lines of a log, plain or gzipped, whose end may be cut short or damaged."""

import logging
import os
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Protocol

from drivers.errors import LogFormatError

logger = logging.getLogger(__name__)

LINE_BYTES = 1 << 20
CHUNK_BYTES = 1 << 16
GZIP_CHUNK_BYTES = 1 << 13
GZIP_MAGIC = b"\x1f\x8b"


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of a log.

    Parameters
    ----------
    number : of the line, from 1.
    text : without the line feed.
    ended : whether a line feed ends it.
    suspect : whether it may be wrong because gzip data are damaged there.
    last : whether it is the last line of the file that is not blank.
    """

    number: int
    text: bytes
    ended: bool
    suspect: bool = False
    last: bool = False


class LogLineReader:
    """Lines of a plain or gzipped file, read in bounded memory; ``kind`` is what error messages say was expected."""

    def __init__(self, path: Path, kind: str = "a CARMEN log") -> None:
        self._path = path
        self._kind = kind
        self._position = 0
        self._size = 0

    @property
    def progress(self) -> float:
        """Share of the file's bytes, compressed ones if it is compressed, that has been read, 0 to 1."""
        return min(self._position / self._size, 1.0) if self._size else 0.0

    def lines(self) -> Iterator[LogLine]:
        """Yield all lines that are not blank, the last of them marked."""
        previous: LogLine | None = None
        for line in self._all_lines():
            if line.text.strip():
                if previous is not None:
                    yield previous
                previous = line
        if previous is not None:
            yield replace(previous, last=True)

    def _all_lines(self) -> Iterator[LogLine]:
        number = 1
        rest = b""
        damaged = False
        for text, damaged in self._pieces():
            *complete, rest = (rest + text).split(b"\n")
            for line in complete:
                yield LogLine(number, line, ended=True, suspect=damaged)
                number += 1
            if len(rest) > LINE_BYTES:
                raise LogFormatError(
                    f"{self._path}, line {number}: longer than {LINE_BYTES} bytes: expected lines of {self._kind}"
                )
        yield LogLine(number, rest, ended=False, suspect=damaged)

    def _pieces(self) -> Iterator[tuple[bytes, bool]]:
        """Yield the text in pieces, each with whether it may be wrong because gzip data are damaged there."""
        try:
            with self._path.open("rb") as file:
                self._size = os.fstat(file.fileno()).st_size
                magic = file.read(len(GZIP_MAGIC))
                file.seek(0)
                for piece in self._gunzip(file) if magic == GZIP_MAGIC else _plain(file):
                    self._position = file.tell()
                    yield piece
                self._position = self._size
        except FileNotFoundError:
            raise LogFormatError(f"{self._path}: no such file: expected {self._kind}") from None
        except IsADirectoryError:
            raise LogFormatError(f"{self._path} is a directory: expected {self._kind}") from None
        except OSError as error:
            raise LogFormatError(
                f"{self._path} cannot be read ({error.strerror or error}): expected {self._kind}"
            ) from error

    def _gunzip(self, file: BinaryIO) -> Iterator[tuple[bytes, bool]]:
        decoder = None
        readable = False
        while chunk := file.read(GZIP_CHUNK_BYTES):
            while chunk := chunk if decoder else chunk.lstrip(b"\0"):  # zeros pad the end of a member
                decoder = decoder or zlib.decompressobj(zlib.MAX_WBITS | 16)
                before = decoder.copy()
                try:
                    text = decoder.decompress(chunk)
                except zlib.error as error:
                    text = _salvage(before, chunk)
                    yield text, True
                    damage = f"the gzip data are damaged before byte {file.tell()} of {self._size} ({error})"
                    self._tolerate(damage, bool(readable or text) and self._size - file.tell() <= GZIP_CHUNK_BYTES)
                    return
                yield text, not decoder.eof and file.tell() == self._size
                readable = readable or bool(text)
                chunk = decoder.unused_data
                if decoder.eof:
                    decoder = None
        if decoder is not None:
            self._tolerate("the gzip data end early", readable)

    def _tolerate(self, damage: str, tolerable: bool) -> None:
        if not tolerable:
            raise LogFormatError(f"{self._path}: {damage}: expected an intact file")
        logger.warning("%s: %s; what can be read is used", self._path, damage)


def _plain(file: BinaryIO) -> Iterator[tuple[bytes, bool]]:
    while chunk := file.read(CHUNK_BYTES):
        yield chunk, False


class _Decompressor(Protocol):
    """What :func:`zlib.decompressobj` returns, whose type has no public name."""

    def decompress(self, data: bytes, /) -> bytes: ...


def _salvage(decoder: _Decompressor, chunk: bytes) -> bytes:
    """Text of damaged gzip data up to the byte at which decompression fails."""
    text = bytearray()
    with suppress(zlib.error):
        for i in range(len(chunk)):
            text += decoder.decompress(chunk[i : i + 1])
    return bytes(text)
