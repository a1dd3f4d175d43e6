"""The commands ``cwlf-slam live``, ``record`` and ``replay``; heavy imports wait until one runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from slam.cli_options import Config, Out, Overwrite, Sensor
from slam.finish_cli import leave, save

if TYPE_CHECKING:
    from drivers.frame import FrameSource
    from drivers.recorder import Recorder
    from drivers.rplidar import RawTap, Rplidar
    from slam.pipeline import Slam
    from slam.session import Progress, Session

RECORDING = "recording.jsonl.gz"
"""File of a live run in which everything that came is kept."""

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

    from drivers.recorder import Recorder
    from drivers.rplidar import RawRecorder, Rplidar
    from drivers.stages import Recorded
    from slam.live_progress import LiveProgress
    from slam.run_folder import claimed, default_folder

    tap = _LateTap()
    with Rplidar(port, mode=mode, rpm=rpm, baud=baud, tap=tap) as lidar:
        source = _with_odometry(lidar, odometry)
        slam = _slam(source, sensor, config)
        with claimed(out or default_folder(f"live-{lidar.name}", datetime.now()), overwrite=overwrite) as folder:
            with _recorder(Recorder, folder / RECORDING, source, overwrite=overwrite) as recorder:
                tap.open(RawRecorder(recorder))
                progress = LiveProgress(lidar.name, slam, lambda: lidar.counts, time.time)
                session = _session(slam, source, progress, view=view, view_file=view_file)
                result, error = session.run(Recorded(source, recorder), limit)
                lidar.close()
            save(folder, f"live {lidar.name}", result, error)
    leave(result)
