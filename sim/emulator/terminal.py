"""An emulated scanner at the end of a pseudo-terminal, in real time."""

import errno
import fcntl
import os
import select
import struct
import termios
import time
import tty
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from features.errors import CwlfError
from sim.emulator.device import Device
from sim.emulator.line import HOST_BUFFER

_TICK = 1e-3
"""Bytes that arrive within this time are written together [s]."""

_PATIENCE = 0.05
"""How long to wait at most before looking whether to stop [s]."""

_READ_TRIES = 200
"""Ticks that the host has to read the last bytes before the cable is pulled."""

_TCGETS2, _TERMIOS2 = 0x802C542A, "=4IB19s2I"
"""Request and layout for the settings of a terminal with their baud rates, also those that POSIX has no name for."""


class EmulatorError(CwlfError):
    """A pseudo-terminal, or a link to it, that cannot be made."""


class Terminal:
    """A pseudo-terminal whose other end is a scanner; a context manager that leaves nothing behind.

    The scanner hears and is heard only at its own baud rate. What it sends while nobody has the terminal open is gone.

    Parameters
    ----------
    device : the scanner; its clock begins when the context is entered.
    link : symbolic link to keep on the terminal; a link that is there is replaced. None for none.
    said : is told the path whenever the scanner is plugged in.
    begin : what the device's clock shows when the context is entered [s].

    Attributes
    ----------
    started : time at which the device's clock was zero [s since 1970].

    Raises
    ------
    EmulatorError
        There is something else where the link should be, or it cannot be made.
    """

    def __init__(
        self,
        device: Device,
        link: Path | None = None,
        said: Callable[[str], None] = lambda path: None,
        begin: float = 0.0,
    ) -> None:
        self._device, self._link, self._said = device, link, said
        self._master: int | None = None
        self._path = ""
        self._backlog = b""
        self._begin = begin
        self._started = self.started = 0.0

    def __enter__(self) -> Self:
        self._started, self.started = time.monotonic() - self._begin, time.time() - self._begin
        self._plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pull_out()
        self._device.end(self.now)

    @property
    def now(self) -> float:
        """Time on the device's clock [s]."""
        return time.monotonic() - self._started

    def serve(self, stopped: Callable[[], bool]) -> None:
        """Be the scanner until told to stop."""
        device = self._device
        while not stopped():
            if self._master is None:
                assert device.away_until is not None
                if self.now < device.away_until:
                    time.sleep(min(_PATIENCE, device.away_until - self.now))
                    continue
                device.plug_in()
                self._plug_in()
            self._pass_on(self._master_fd)
            if device.away_until is not None:
                self._let_read()
                self._pull_out()
                continue
            wait = min(max(device.next_time - self.now, _TICK), _PATIENCE)
            self._listen(self._master_fd, wait)

    @property
    def _master_fd(self) -> int:
        assert self._master is not None
        return self._master

    def _pass_on(self, master: int) -> None:
        """Write what has arrived by now."""
        self._backlog += self._device.read(self.now, _baud(master))
        if not self._backlog:
            return
        if _hung_up(master):
            self._device.ledger.loss("nobody").bytes += len(self._backlog)
            self._backlog = b""
            return
        with suppress(OSError):  # it is full, or was just closed
            self._backlog = self._backlog[os.write(master, self._backlog) :]
        if (excess := len(self._backlog) - HOST_BUFFER) > 0:
            loss = self._device.ledger.loss("overflow")
            loss.events, loss.bytes = loss.events + 1, loss.bytes + excess
            self._backlog = self._backlog[:-excess]

    def _listen(self, master: int, wait: float) -> None:
        """Take requests in for a while [s], or sleep as long where nobody has the terminal open."""
        if not select.select([master], [], [], wait)[0]:
            return
        try:
            data = os.read(master, 4096)
        except OSError:
            data = b""
        if data:
            self._device.write(data, self.now, _baud(master))
        else:
            time.sleep(wait)

    def _plug_in(self) -> None:
        master, slave = os.openpty()
        tty.setraw(slave)
        path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(master, False)
        self._master, self._path, self._backlog = master, path, b""
        if self._link is not None:
            try:
                _make_link(self._link, path)
            except OSError as error:
                self._pull_out()
                raise EmulatorError(f"{self._link}: no link can be made here: {error.strerror}") from None
        self._said(path)

    def _let_read(self) -> None:
        """Wait until the host has what was sent before the cable is pulled: else the counts would not be exact."""
        terminal = os.open(self._path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            for _ in range(_READ_TRIES):
                (waiting,) = struct.unpack("=i", fcntl.ioctl(terminal, termios.FIONREAD, bytes(4)))
                if waiting == 0:
                    break
                time.sleep(_TICK)
        finally:
            os.close(terminal)

    def _pull_out(self) -> None:
        if self._master is not None:
            os.close(self._master)
            self._master = None
        if self._link is not None and self._link.is_symlink() and os.readlink(self._link) == self._path:
            self._link.unlink()


def _make_link(link: Path, path: str) -> None:
    """Make or replace a symbolic link."""
    if link.exists() and not link.is_symlink():
        raise FileExistsError(errno.EEXIST, "there is something else", str(link))
    fresh = link.with_name(f".{link.name}.{os.getpid()}")
    fresh.symlink_to(path)
    fresh.replace(link)


def _hung_up(master: int) -> bool:
    """Whether nobody has the terminal open."""
    poll = select.poll()
    poll.register(master, 0)
    return any(event & select.POLLHUP for _, event in poll.poll(0))


def _baud(master: int) -> int | None:
    """Rate that the host has set; None where the system does not tell."""
    try:
        settings = fcntl.ioctl(master, _TCGETS2, bytes(struct.calcsize(_TERMIOS2)))
    except OSError:
        return None
    return struct.unpack(_TERMIOS2, settings)[-1]
