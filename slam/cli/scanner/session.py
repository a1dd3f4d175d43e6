"""Parts of the commands ``live``, ``record`` and ``replay``: odometry, and the session with its view."""

from __future__ import annotations

from contextlib import ExitStack, closing, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

    from drivers.frame import Frame, FrameSource
    from drivers.recording.recorder import Recorder
    from slam.pipeline import Slam
    from slam.run.progress import Progress
    from slam.run.session import Session
    from slam.step import Step


def with_odometry(source: FrameSource, odometry: str | None) -> FrameSource:
    """Source with the odometry that another program writes to a file; unchanged where there is none."""
    from drivers.adapters import WithOdometry
    from drivers.odometry_stream import OdometryStream

    return source if odometry is None else WithOdometry(source, OdometryStream(odometry))


@contextmanager
def open_session(
    slam: Slam,
    source: FrameSource,
    progress: Progress,
    recorder: Recorder | None = None,
    *,
    view: bool,
    view_file: Path | None,
) -> Generator[Session]:
    """Session whose frames are recorded and shown where that is wanted; the view is complete at the end."""
    from slam.run.checkpoint import LogPosition
    from slam.run.session import Session

    with ExitStack() as stack:
        shown = None
        if view or view_file is not None:
            from slam.pictures.live_view import LiveView

            shown = stack.enter_context(closing(LiveView(source.name, slam, view_file)))

        def watch(frame: Frame, step: Step) -> None:
            # Ctrl-C does not interrupt this function: it would leave half a line in the recording.
            if recorder is not None:
                recorder.write(frame)
            if shown is not None:
                shown.show(frame, step)

        yield Session(slam, LogPosition(source.name), progress=progress, on_step=watch)
