"""The commands ``cwlf-slam live``, ``record`` and ``replay``; heavy imports wait until one runs."""

from __future__ import annotations

from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slam.cli.finish import leave, save
from slam.cli.options import Config, Out, Overwrite, Sensor

if TYPE_CHECKING:
    from collections.abc import Iterator

    from drivers.frame import Frame, FrameSource
    from drivers.recording.recorder import Recorder
    from drivers.rplidar import Rplidar
    from slam.pipeline import Slam
    from slam.run.progress import Progress
    from slam.run.session import Session
    from slam.step import Step

RECORDING = "recording.jsonl.gz"
"""File of a live run in which everything that came is kept."""

PATIENT = 100
"""Revolutions that wait to be recorded, where the disk or the computer is busy for a while."""

Port = Annotated[
    str | None, typer.Option("--port", help="Serial port; default: the first with a scanner.", show_default=False)
]
Mode = Annotated[
    str | None, typer.Option("--mode", help="Scan mode by its name; default: the typical one.", show_default=False)
]
Rpm = Annotated[int | None, typer.Option("--rpm", min=1, help="Speed of an S-series scanner; default: 600.")]
Baud = Annotated[int | None, typer.Option("--baud", min=1, help="Speed of the link; default: found out.")]
Odometry = Annotated[
    str | None,
    typer.Option(
        "--odometry",
        help="Where another program writes wheel odometry, lines `stamp x y theta` [s since 1970, m, rad]: a FIFO or a "
        "file; - for the standard input. Default: none, the walls alone carry the motion.",
        show_default=False,
    ),
]
Limit = Annotated[int | None, typer.Option("--limit", min=1, help="Stop after so many scans.", show_default=False)]
View = Annotated[bool, typer.Option("--view", help="Show the growing map, in a window or in a browser.")]
ViewFile = Annotated[
    Path | None,
    typer.Option("--view-file", help="Write what --view would show, for `rerun FILE`.", show_default=False),
]


def live(
    port: Port = None,
    mode: Mode = None,
    rpm: Rpm = None,
    baud: Baud = None,
    odometry: Odometry = None,
    sensor: Sensor = None,
    config: Config = None,
    out: Out = None,
    limit: Limit = None,
    view: View = False,
    view_file: ViewFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Map with a scanner as it scans, until Ctrl-C; write a run folder like `run` does, and a recording beside it.

    A run that is killed leaves the recording: `run RECORDING` maps it again.
    """
    import time
    from datetime import datetime

    from drivers.rplidar import RawRecorder, Rplidar
    from slam import pipeline  # noqa: F401, what is compiled is there before the motor turns
    from slam.config_file import load_config
    from slam.run.folder import claimed, default_folder
    from slam.run.live_progress import LiveProgress

    load_config(config, preset=sensor)  # one that is wrong is told before the motor turns
    with Rplidar(port, mode=mode, rpm=rpm, baud=baud) as lidar:
        source = _with_odometry(lidar, odometry)
        slam = _slam(source, sensor, config)
        with claimed(out or default_folder(f"live-{lidar.name}", datetime.now()), overwrite=overwrite) as folder:
            with _recorder(folder / RECORDING, source, overwrite=overwrite) as recorder:
                lidar.start(RawRecorder(recorder))
                progress = LiveProgress(lidar.name, slam, lambda: lidar.counts, time.time)
                with _session(slam, source, progress, recorder, view=view, view_file=view_file) as session:
                    result, error = session.run(source, limit)
                lidar.close()
            save(folder, f"live {lidar.name}", result, error)
    leave(result)


def record(
    out: Annotated[Path, typer.Option("--out", help="Recording to write, such as hall.jsonl.gz.", show_default=False)],
    port: Port = None,
    mode: Mode = None,
    rpm: Rpm = None,
    baud: Baud = None,
    odometry: Odometry = None,
    limit: Limit = None,
    overwrite: Overwrite = False,
) -> None:
    """Record a scanner until Ctrl-C: its bytes as they come, and the scans that they make.

    What a killed recording leaves is readable up to its last second.
    """
    from drivers.rplidar import RawRecorder, Rplidar
    from slam.run.interrupt import Interrupt
    from slam.run.live_progress import LiveProgress

    scans, seconds = 0, 0.0
    with Rplidar(port, mode=mode, rpm=rpm, baud=baud, capacity=PATIENT) as lidar:
        source = _with_odometry(lidar, odometry)
        with (
            _recorder(out, source, overwrite=overwrite) as recorder,
            Interrupt() as interrupt,
            LiveProgress(lidar.name, counts=lambda: lidar.counts) as progress,
        ):
            lidar.start(RawRecorder(recorder))
            first: float | None = None
            for frame in interrupt.until(source):
                recorder.write(frame)
                scans += 1
                first = frame.stamp if first is None else first
                seconds = frame.stamp - first
                progress.update(source.progress, scans)
                if scans == limit:
                    break
            lidar.close()
        counts = lidar.counts
    typer.echo(
        f"{scans} scans, {seconds:.0f} s of data; {counts.dropped_bytes} bytes and {counts.broken_revolutions} "
        f"revolutions lost, {counts.reconnects} reconnects"
    )
    typer.echo(f"recording: {out}")


def replay(
    recording: Annotated[Path, typer.Argument(help="Recording of `record` or `live`, or any.", show_default=False)],
    speed: Annotated[
        float, typer.Option("--speed", min=0.0, help="How many times as fast as it was taken; 0: as fast as it goes.")
    ] = 1.0,
    sensor: Sensor = None,
    config: Config = None,
    out: Out = None,
    limit: Limit = None,
    view: View = False,
    view_file: ViewFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Map a recording as if it were live: from the bytes of the scanner where they were kept, else from its scans."""
    from datetime import datetime

    from drivers.recording.recording import Recording
    from drivers.rplidar import RawRecording
    from drivers.rplidar.raw_recording import has_raw_bytes
    from drivers.stages import Paced
    from slam.run.folder import claimed, default_folder
    from slam.run.live_progress import LiveProgress

    kept = Recording(recording)
    raw = RawRecording(recording) if has_raw_bytes(kept) else None
    source = kept if raw is None else raw
    slam = _slam(source, sensor, config)
    with claimed(out or default_folder(f"replay-{source.name}", datetime.now()), overwrite=overwrite) as folder:
        progress = LiveProgress(source.name, slam, None if raw is None else lambda: raw.counts)
        with _session(slam, source, progress, view=view, view_file=view_file) as session:
            result, error = session.run(Paced(source, speed) if speed > 0.0 else source, limit)
        save(folder, f"replay {source.name}", result, error)
    leave(result)


def _with_odometry(lidar: Rplidar, odometry: str | None) -> FrameSource:
    from drivers.odometry_stream import OdometryStream
    from drivers.stages import WithOdometry

    return lidar if odometry is None else WithOdometry(lidar, OdometryStream(odometry))


def _recorder(path: Path, source: FrameSource, *, overwrite: bool) -> Recorder:
    from drivers.recording.recorder import Recorder

    return Recorder(
        path,
        name=source.name,
        sensor=source.sensor,
        mounting=source.mounting,
        odometry=source.has_odometry,
        overwrite=overwrite,
    )


def _slam(source: FrameSource, sensor: str | None, config: Path | None) -> Slam:
    from slam.config_file import load_config
    from slam.pipeline import Slam

    return Slam(
        load_config(
            config,
            preset=sensor,
            source_preset=source.sensor,
            source_mounting=source.mounting,
            source_odometry=source.has_odometry,
        )
    )


@contextmanager
def _session(
    slam: Slam,
    source: FrameSource,
    progress: Progress,
    recorder: Recorder | None = None,
    *,
    view: bool,
    view_file: Path | None,
) -> Iterator[Session]:
    """Session of a run that may be recorded and watched; the view is complete behind it."""
    from slam.run.checkpoint import Stand
    from slam.run.session import Session

    with ExitStack() as stack:
        shown = None
        if view or view_file is not None:
            from slam.pictures.live_view import LiveView

            shown = stack.enter_context(closing(LiveView(source.name, slam, view_file)))

        def watch(frame: Frame, step: Step) -> None:
            # Here no Ctrl-C breaks in: it would leave half a line in the recording.
            if recorder is not None:
                recorder.write(frame)
            if shown is not None:
                shown.show(frame, step)

        yield Session(slam, Stand(source.name), progress=progress, watch=watch)
