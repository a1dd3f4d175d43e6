"""A source run through SLAM: with progress, checkpoints, and an early end where it is asked for or the data break."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.frame import Frame, FrameSource
from features.errors import CwlfError
from slam.errors import DivergedError, RunFolderError
from slam.pipeline import Slam
from slam.result.result import SlamResult
from slam.run.checkpoint import LogPosition, discard_checkpoint, write_checkpoint
from slam.run.frame_digest import extend_digest
from slam.run.interrupt import Interrupt
from slam.run.progress import Progress
from slam.step import Step

LEAST_INTERVAL_S = 10.0
"""Between two checkpoints [s]."""

LEAST_SHARE = 30.0
"""Least time between two checkpoints, as a multiple of the time that writing one took."""


@dataclass(slots=True)
class Session:
    """A run in its folder.

    Parameters
    ----------
    slam : new, or read from a checkpoint.
    position : the frames that it has processed.
    progress : shows how far the run is.
    folder : where checkpoints go; None for a run that is not kept.
    on_step : sees every frame and what it did.
    """

    slam: Slam
    position: LogPosition
    progress: Progress
    folder: Path | None = None
    on_step: Callable[[Frame, Step], None] | None = None

    def run(self, source: FrameSource, limit: int | None = None) -> tuple[SlamResult, CwlfError | None]:
        """Process frames until the source ends or breaks, a signal comes or ``limit`` scans are done; then solve.

        A run that the source did not end leaves a checkpoint.

        Returns
        -------
        result : of what was done.
        error : with which the source broke, None where it did not.

        Raises
        ------
        CwlfError
            Nothing usable came before the error, or the source does not begin with what was processed.
        KeyboardInterrupt
            Nothing came before the signal.
        """
        error: CwlfError | None = None
        complete = False
        with Interrupt() as interrupt:
            with self.progress as progress:
                frames = interrupt.until(self._following(source))
                try:
                    complete = self._process(frames, source, progress, limit)
                except CwlfError as broken:
                    error = broken
                if self.slam.scans == 0:
                    raise error or KeyboardInterrupt
                if interrupt.requested:
                    progress.say("stopping: what was done so far is solved and saved; Ctrl-C again to give up")
                if complete and not interrupt.requested:
                    self._discard()
                # A filter that diverged in the middle of a frame is no place to go on from.
                elif not isinstance(error, DivergedError):
                    self._keep()
                progress.solving()
            return self.slam.finish(interrupted=interrupt.requested), error

    def _process(self, frames: Iterator[Frame], source: FrameSource, progress: Progress, limit: int | None) -> bool:
        """Process frames; whether they came to their end."""
        due = time.monotonic() + LEAST_INTERVAL_S
        for frame in frames:
            if self.slam.scans == limit:
                return False
            step = self.slam.process(frame)
            if self.on_step is not None:
                self.on_step(frame, step)
            if self.folder is not None:
                digest = extend_digest(self.position.digest, frame)
                self.position = LogPosition(self.position.log, self.position.records + 1, digest)
            if frame.scan is not None or frame.observations is not None:
                progress.update(source.progress, self.slam.scans)
            if time.monotonic() >= due:
                began = time.monotonic()
                self._keep()
                ended = time.monotonic()
                due = ended + max(LEAST_INTERVAL_S, LEAST_SHARE * (ended - began))
        return True

    def _following(self, source: FrameSource) -> Iterator[Frame]:
        """Frames of the source after those already processed; these are verified by their digest.

        Raises
        ------
        RunFolderError
            They are not.
        """
        frames = iter(source)
        digest = b""
        count = 0
        while count < self.position.records and (frame := next(frames, None)) is not None:
            digest = extend_digest(digest, frame)
            count += 1
        if digest != self.position.digest:
            raise RunFolderError(
                f"{self.folder}: the run of {self.position.log} was stopped after {self.position.records} records, and "
                f"{source.name} does not begin with the same; give the log that the run was started with"
            )
        return frames

    def _keep(self) -> None:
        if self.folder is not None:
            write_checkpoint(self.folder, self.slam, self.position)

    def _discard(self) -> None:
        if self.folder is not None:
            discard_checkpoint(self.folder)
