"""The command ``cwlf-slam replay``; heavy imports wait until it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from slam.cli.finish import leave, save
from slam.cli.options import Config, Out, Overwrite, Sensor
from slam.cli.scanner.options import Limit, View, ViewFile
from slam.cli.scanner.session import open_session


def replay(
    recording: Annotated[Path, typer.Argument(help="Recording of `record` or `live`, or any.", show_default=False)],
    speed: Annotated[
        float, typer.Option("--speed", min=0.0, help="How many times faster than recorded; 0: as fast as possible.")
    ] = 1.0,
    sensor: Sensor = None,
    config: Config = None,
    out: Out = None,
    limit: Limit = None,
    view: View = False,
    view_file: ViewFile = None,
    overwrite: Overwrite = False,
) -> None:
    """Map a recording as if it were live: from the bytes of the scanner where they were recorded, else its scans."""
    from datetime import datetime

    from drivers.adapters import Paced
    from drivers.recording.raw_recording import RawRecording, has_raw_bytes
    from drivers.recording.recording import Recording
    from slam.config_file import load_config
    from slam.pipeline import Slam
    from slam.run.folder import claimed, default_folder
    from slam.run.live_progress import LiveProgress

    decoded = Recording(recording)
    raw = RawRecording(recording) if has_raw_bytes(decoded) else None
    source = decoded if raw is None else raw
    slam = Slam(load_config(config, preset=sensor, source=source.info))
    with claimed(out or default_folder(f"replay-{source.name}", datetime.now()), overwrite=overwrite) as folder:
        progress = LiveProgress(source.name, slam, None if raw is None else lambda: raw.counts)
        with open_session(slam, source, progress, view=view, view_file=view_file) as session:
            result, error = session.run(Paced(source, speed) if speed > 0.0 else source, limit)
        save(folder, f"replay {source.name}", result, error)
    leave(result)
