"""Options that several commands share."""

from pathlib import Path
from typing import Annotated, Literal

import typer

LOG = (
    "CARMEN log (.clf or .log) or list of edges, also gzipped; ROS bag (.bag, .mcap, .db3 or a folder); recording; "
    "folder of an MRCLAM data set; or victoria-park, which comes with GTSAM."
)

ScanTopic = Annotated[
    str | None,
    typer.Option("--scan-topic", help="Scans of a ROS bag to take; default: the only ones.", show_default=False),
]
OdomTopic = Annotated[
    str | None,
    typer.Option(
        "--odom-topic", help="Odometry of a ROS bag; default: the only one, else tf, else none.", show_default=False
    ),
]

Out = Annotated[Path | None, typer.Option("--out", help="Run folder; default runs/<name>-<date>.", show_default=False)]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write into the run folder although it is not empty.")]
Sensor = Annotated[
    str | None,
    typer.Option(
        "--sensor",
        help="Sensor preset, such as rplidar-s1 or mrclam-camera; default: the source's.",
        show_default=False,
    ),
]
Config = Annotated[
    Path | None,
    typer.Option("--config", help="TOML file with any of the keys that `cwlf-slam config` prints."),
]

EffectsOption = Annotated[
    Literal["off", "on", "ideal", "rplidar-s1", "rplidar-a1", "rplidar-a2", "rplidar-a3", "rplidar-s2", "sick-lms"],
    typer.Option(
        "--effects",
        help="What the scanner does beside the noise of the paper, such as motion during a sweep, mixed pixels, lost "
        "beams, glass and steps: on, that of the scanner itself; that of a named one; or off, also ideal, nothing.",
    ),
]
SimulatedSensor = Annotated[
    str, typer.Option("--sensor", help="Sensor preset of a laser scanner, such as rplidar-s1, rplidar-a1 or sick-lms.")
]
OdometryOption = Annotated[
    Literal["exact", "good", "poor", "slipping"], typer.Option("--odometry", help="Errors of the wheels.")
]
People = Annotated[int, typer.Option("--people", min=0, help="People who go to and fro beside the path.")]


def check_simulated(sensor: str) -> None:
    """Check that a scanner of this preset can be simulated.

    Raises
    ------
    ConfigError
        No preset has this name, or it is no laser scanner.
    """
    from sim.sensing.lidar import Lidar
    from slam.errors import ConfigError

    try:
        Lidar.of_preset(sensor)
    except ValueError as error:
        raise ConfigError(f"--sensor: {error}") from None
