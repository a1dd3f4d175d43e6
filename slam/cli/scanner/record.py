"""The command ``cwlf-slam record``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slam.cli.options import Overwrite
from slam.cli.scanner.options import DEFAULT_SCANNER, Baud, Limit, Mode, Odometry, Port, Rpm, ScannerName
from slam.cli.scanner.session import with_odometry

CAPACITY = 100
"""Revolutions that are kept until they are recorded, where the disk or the computer is busy for a while."""


def record(
    out: Annotated[Path, typer.Option("--out", help="Recording to write, such as hall.jsonl.gz.", show_default=False)],
    scanner: ScannerName = DEFAULT_SCANNER,
    port: Port = None,
    mode: Mode = None,
    rpm: Rpm = None,
    baud: Baud = None,
    odometry: Odometry = None,
    limit: Limit = None,
    overwrite: Overwrite = False,
) -> None:
    """Record a scanner until Ctrl-C: its bytes as they arrive, and the scans that are decoded from them.

    The recording of a killed process is readable up to its last second.
    """
    from drivers.live_source import LiveOptions
    from drivers.recording.raw_recording import RawRecorder
    from drivers.recording.recorder import Recorder
    from drivers.scanners import find_scanner
    from slam.run.interrupt import Interrupt
    from slam.run.live_progress import LiveProgress

    scans, seconds = 0, 0.0
    with find_scanner(scanner).connect(LiveOptions(port, mode, rpm, baud, CAPACITY)) as lidar:
        source = with_odometry(lidar, odometry)
        with (
            Recorder(out, source.info, overwrite=overwrite) as recorder,
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
