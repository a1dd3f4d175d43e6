"""Exact counts of what an emulated scanner has sent, and of what each fault has destroyed of it."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Revolutions = npt.NDArray[np.int64]

_FIRST = "begin"
"""Why a revolution is not whole in which a scan began: nobody's fault."""


@dataclass(slots=True)
class Loss:
    """What one cause has destroyed.

    Parameters
    ----------
    events : times it struck.
    bytes : that did not arrive, or arrived as others.
    packets : that it hit.
    debris : bytes of these that did arrive: no packet can be made of them.
    samples : that cannot be decoded; those of a capsule are lost with the capsule after it.
    revolutions : that lack a sample; a revolution that several causes hit is the first one's.
    """

    events: int = 0
    bytes: int = 0
    packets: int = 0
    debris: int = 0
    samples: int = 0
    revolutions: int = 0


@dataclass(slots=True)
class Ledger:
    """Counts of all scans that the host asked for.

    Attributes
    ----------
    packets, samples, revolutions : that arrived whole. A revolution is whole when all its samples are, and the first
        of the next one was taken.
    losses : by cause: a fault, ``stop`` (the host ended the scan) or ``overflow`` (it read too late).
    """

    packets: int = 0
    samples: int = 0
    revolutions: int = 0
    losses: dict[str, Loss] = field(default_factory=dict)
    _waiting: tuple[Revolutions, str | None] | None = None
    _open: int | None = None
    _cause: str | None = None

    def loss(self, cause: str) -> Loss:
        """Loss by a cause, to be added to."""
        return self.losses.setdefault(cause, Loss())

    def packet(self, revolutions: Revolutions, follows: bool, cause: str | None) -> None:
        """Count a capsule, whose samples the next one completes.

        Parameters
        ----------
        revolutions : number of the revolution of each sample, shape (n,).
        follows : whether the angle was kept since the one before; it was not at an encoder reset.
        cause : why it did not arrive whole; None where it did.
        """
        self._settle(cause if follows else "encoder-reset")
        if not follows:
            self._hit(int(revolutions[0]), "encoder-reset")
        self._count(cause, 1)
        self._waiting = revolutions, cause

    def nodes(self, revolutions: Revolutions, follows: bool, lost: npt.NDArray[np.bool_], cause: str | None) -> None:
        """Count packets that are complete in themselves.

        Parameters
        ----------
        revolutions : number of the revolution of each sample, a row for each packet, shape (m, n).
        follows : as for :meth:`packet`.
        lost : whether each packet is, shape (m,).
        cause : why; None where none is.
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
        """Count the end of a scan: the last capsule lacks a next one, the last revolution its end."""
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
        """Count the samples of the capsule that waits for a next one; with a cause, there is none for it."""
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
        """Go on to a revolution, and note why it is not whole."""
        if revolution is None:
            return
        if revolution != self._open:
            self._close()
            self._cause = None if self._open is not None else _FIRST
            self._open = revolution
        self._cause = self._cause or cause

    def _close(self) -> None:
        if self._open is None or self._cause == _FIRST:
            return
        if self._cause is None:
            self.revolutions += 1
        else:
            self.loss(self._cause).revolutions += 1
