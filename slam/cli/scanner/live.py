"""The command ``cwlf-slam live``; heavy imports wait until it runs."""

from __future__ import annotations

from slam.cli.finish import leave, save
from slam.cli.options import Config, Out, Overwrite, Sensor
from slam.cli.scanner.options import (
    DEFAULT_SCANNER,
    Baud,
    Limit,
    Mode,
    Odometry,
    Port,
    Rpm,
    ScannerName,
    View,
    ViewFile,
)
from slam.cli.scanner.session import open_session, with_odometry

RECORDING = "recording.jsonl.gz"
"""File in the run folder with the recorded scans and bytes."""


def live(
    scanner: ScannerName = DEFAULT_SCANNER,
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
    """Map with a scanner as it scans, until Ctrl-C; write a run folder like `run` does, and a recording in it.

    A run that is killed leaves the recording: `run RECORDING` maps it again.
    """
    import time
    from datetime import datetime

    from drivers.live_source import LiveOptions
    from drivers.recording.raw_recording import RawRecorder
    from drivers.recording.recorder import Recorder
    from drivers.scanners import find_scanner
    from slam.config_file import load_config
    from slam.pipeline import Slam  # loads what is compiled, before the motor turns
    from slam.run.folder import claimed, default_folder
    from slam.run.live_progress import LiveProgress

    connect = find_scanner(scanner).connect
    load_config(config, preset=sensor)  # errors in it are reported before the motor turns
    with connect(LiveOptions(port, mode, rpm, baud)) as lidar:
        source = with_odometry(lidar, odometry)
        slam = Slam(load_config(config, preset=sensor, source=source.info))
        with claimed(out or default_folder(f"live-{lidar.name}", datetime.now()), overwrite=overwrite) as folder:
            with Recorder(folder / RECORDING, source.info, overwrite=overwrite) as recorder:
                lidar.start(RawRecorder(recorder))
                progress = LiveProgress(lidar.name, slam, lambda: lidar.counts, time.time)
                with open_session(slam, source, progress, recorder, view=view, view_file=view_file) as session:
                    result, error = session.run(source, limit)
                lidar.close()
            save(folder, f"live {lidar.name}", result, error)
    leave(result)
