"""SLAM on CWLF corners: EKF front-end, factor-graph back-end, metrics and the command line."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from slam.config import SlamConfig
    from slam.config_file import load_config
    from slam.evaluation.metrics import ate, rpe
    from slam.map.landmark_map import LandmarkMap
    from slam.pipeline import Slam
    from slam.result.result import SlamResult
    from slam.result.trajectory import Trajectory
    from slam.run.folder import save_run
    from slam.step import Step

__all__ = [
    "LandmarkMap",
    "Slam",
    "SlamConfig",
    "SlamResult",
    "Step",
    "Trajectory",
    "ate",
    "load_config",
    "rpe",
    "save_run",
]

_HOMES = {
    "LandmarkMap": "slam.map.landmark_map",
    "Slam": "slam.pipeline",
    "SlamConfig": "slam.config",
    "SlamResult": "slam.result.result",
    "Step": "slam.step",
    "Trajectory": "slam.result.trajectory",
    "ate": "slam.evaluation.metrics",
    "load_config": "slam.config_file",
    "rpe": "slam.evaluation.metrics",
    "save_run": "slam.run.folder",
}


def __getattr__(name: str) -> Any:
    # Loaded on first use: the command line imports this package and must answer --help at once.
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
