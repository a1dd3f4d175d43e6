"""An emulated scanner on a pseudo-terminal, in real time."""

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
"""Bytes that arrive within this time are written together [s], as a USB bridge does."""

_PATIENCE = 0.05
"""Longest wait before :meth:`Terminal.serve` checks whether to stop [s]."""

_READ_TRIES = 200
"""Ticks that the host has to read the last bytes before the cable is unplugged: 0.2 s, far more than a reader needs."""

_TCGETS2, _TERMIOS2 = 0x802C542A, "=4IB19s2I"
"""Request and layout of the settings of a terminal (Linux), whose baud rates may be others than those of POSIX."""


class EmulatorError(CwlfError):
    """A link to a pseudo-terminal cannot be made."""


class Terminal:
    """A pseudo-terminal whose other end is an emulated scanner; a context manager that removes it in the end.

    The scanner and the host understand each other only at the baud rate of the scanner. What the scanner sends while
    nobody has the terminal open is lost.

    Parameters
    ----------
    device : the scanner; its clock starts when the context is entered.
    link : symbolic link to the terminal, which replaces an existing link; None for no link.
    on_plug_in : called with the path of the terminal whenever the scanner is plugged in.
    start : time of the clock of the device when the context is entered [s].

    Attributes
    ----------
    started : time at which the clock of the device was zero [s since 1970].

    Raises
    ------
    EmulatorError
        Something other than a link exists at ``link``, or the link cannot be made.
    """

    def __init__(
        self,
        device: Device,
        link: Path | None = None,
        on_plug_in: Callable[[str], None] = lambda path: None,
        start: float = 0.0,
    ) -> None:
        self._device, self._link, self._on_plug_in = device, link, on_plug_in
        self._master: int | None = None
        self._path = ""
        self._backlog = b""
        self._start = start
        self._started = self.started = 0.0

    def __enter__(self) -> Self:
        self._started, self.started = time.monotonic() - self._start, time.time() - self._start
        self._plug_in()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._unplug()
        self._device.end(self.now)

    @property
    def now(self) -> float:
        """Time of the clock of the device [s]."""
        return time.monotonic() - self._started

    def serve(self, stopped: Callable[[], bool]) -> None:
        """Exchange bytes with the host in real time until ``stopped()`` is true."""
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
                self._unplug()
                continue
            wait = min(max(device.next_time - self.now, _TICK), _PATIENCE)
            self._listen(self._master_fd, wait)

    @property
    def _master_fd(self) -> int:
        assert self._master is not None
        return self._master

    def _pass_on(self, master: int) -> None:
        """Write the bytes that have arrived by now."""
        self._backlog += self._device.read(self.now, _baud(master))
        if not self._backlog:
            return
        if _hung_up(master):
            self._device.ledger.loss("nobody").bytes += len(self._backlog)
            self._backlog = b""
            return
        with suppress(OSError):  # the terminal is full, or was just closed
            self._backlog = self._backlog[os.write(master, self._backlog) :]
        if (excess := len(self._backlog) - HOST_BUFFER) > 0:
            loss = self._device.ledger.loss("overflow")
            loss.events, loss.bytes = loss.events + 1, loss.bytes + excess
            self._backlog = self._backlog[:-excess]

    def _listen(self, master: int, wait: float) -> None:
        """Take requests for some time [s], or sleep as long where nobody has the terminal open."""
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
                self._unplug()
                raise EmulatorError(f"{self._link}: no link can be made here: {error.strerror}") from None
        self._on_plug_in(path)

    def _let_read(self) -> None:
        """Wait until the host has read all bytes, so that the counts are exact although the cable is unplugged next."""
        terminal = os.open(self._path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            for _ in range(_READ_TRIES):
                (waiting,) = struct.unpack("=i", fcntl.ioctl(terminal, termios.FIONREAD, bytes(4)))
                if waiting == 0:
                    break
                time.sleep(_TICK)
        finally:
            os.close(terminal)

    def _unplug(self) -> None:
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
    """Return the baud rate that the host has set; None where the system does not report it."""
    try:
        settings = fcntl.ioctl(master, _TCGETS2, bytes(struct.calcsize(_TERMIOS2)))
    except OSError:
        return None
    return struct.unpack(_TERMIOS2, settings)[-1]
