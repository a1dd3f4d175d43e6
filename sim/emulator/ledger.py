"""Exact counts of what an emulated scanner has sent, and of what each fault has destroyed."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Revolutions = npt.NDArray[np.int64]
"""Numbers of the revolutions of samples."""

_SCAN_START = "scan-start"
"""Cause of an incomplete revolution in which a scan started; it is no loss."""


@dataclass(slots=True)
class Loss:
    """Counts of what one cause has destroyed.

    Parameters
    ----------
    events : number of times that it occurred.
    bytes : number of bytes that did not arrive, or arrived with another value.
    packets : number of packets that it damaged.
    debris : number of bytes of damaged packets that did arrive.
    samples : number of samples that cannot be decoded; those of a capsule need the next capsule too.
    revolutions : number of revolutions that lack a sample; each is counted for the first cause.
    """

    events: int = 0
    bytes: int = 0
    packets: int = 0
    debris: int = 0
    samples: int = 0
    revolutions: int = 0


@dataclass(slots=True)
class Ledger:
    """Counts over all scans that the host has requested.

    Attributes
    ----------
    packets, samples, revolutions : numbers of those that arrived complete. A revolution is complete when all its
        samples are, and the first one of the next revolution was taken.
    losses : losses by cause: a fault, ``stop`` (the host ended the scan), ``nobody`` (the terminal was closed), or
        ``overflow`` (the host read too late).
    """

    packets: int = 0
    samples: int = 0
    revolutions: int = 0
    losses: dict[str, Loss] = field(default_factory=dict[str, Loss])
    _waiting: tuple[Revolutions, str | None] | None = None
    _open: int | None = None
    _cause: str | None = None

    def loss(self, cause: str) -> Loss:
        """Return the loss by a cause, for the caller to add to."""
        return self.losses.setdefault(cause, Loss())

    def packet(self, revolutions: Revolutions, follows: bool, cause: str | None) -> None:
        """Count a capsule, whose samples need the next capsule to be decoded.

        Parameters
        ----------
        revolutions : number of the revolution of each sample, shape (n,).
        follows : whether the angle continues from the packet before; after an encoder reset it does not.
        cause : cause of the loss of the packet; None where it arrived complete.
        """
        self._settle(cause if follows else "encoder-reset")
        if not follows:
            self._hit(int(revolutions[0]), "encoder-reset")
        self._count(cause, 1)
        self._waiting = revolutions, cause

    def nodes(self, revolutions: Revolutions, follows: bool, lost: npt.NDArray[np.bool_], cause: str | None) -> None:
        """Count packets that are decoded on their own.

        Parameters
        ----------
        revolutions : number of the revolution of each sample, a row for each packet, shape (m, n).
        follows : as for :meth:`packet`.
        lost : whether each packet is lost, shape (m,).
        cause : cause of the loss; None where none is lost.
        """
        if not follows:
            self._hit(self._open, "encoder-reset")
            self._hit(int(revolutions[0, 0]), "encoder-reset")
        self._count(None, int((~lost).sum()))
        self._count(cause, int(lost.sum()))
        if not lost.any():
            self._samples(revolutions.reshape(-1), None)
            return
        for row, gone in zip(revolutions, lost, strict=True):
            self._samples(row, cause if gone else None)

    def end(self, cause: str) -> None:
        """Count the end of a scan: its last capsule cannot be decoded, its last revolution is incomplete."""
        self._settle(cause)
        self._hit(self._open, cause)
        self._close()
        self._open = None

    def _count(self, cause: str | None, packets: int) -> None:
        if cause is None:
            self.packets += packets
        else:
            self.loss(cause).packets += packets

    def _settle(self, cause: str | None) -> None:
        """Count the samples of the last capsule: lost if it was, or if the next capsule is lost by ``cause``."""
        if self._waiting is not None:
            revolutions, own = self._waiting
            self._samples(revolutions, own or cause)
            self._waiting = None

    def _samples(self, revolutions: Revolutions, cause: str | None) -> None:
        if cause is None:
            self.samples += len(revolutions)
        else:
            self.loss(cause).samples += len(revolutions)
        for revolution in range(int(revolutions[0]), int(revolutions[-1]) + 1):
            self._hit(revolution, cause)

    def _hit(self, revolution: int | None, cause: str | None) -> None:
        """Go on to a revolution, and note the first cause by which it is incomplete."""
        if revolution is None:
            return
        if revolution != self._open:
            self._close()
            self._cause = None if self._open is not None else _SCAN_START
            self._open = revolution
        self._cause = self._cause or cause

    def _close(self) -> None:
        if self._open is None or self._cause == _SCAN_START:
            return
        if self._cause is None:
            self.revolutions += 1
        else:
            self.loss(self._cause).revolutions += 1
