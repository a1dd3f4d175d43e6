"""The figures of a run, as metrics.json holds them."""

from dataclasses import asdict, dataclass

import numpy as np

from features.noise.gauge import NoiseSummary
from slam.filter.association import ObservationCounts
from slam.filter.landmark_table import LandmarkCounts
from slam.loop.rules import LoopCounts
from slam.odometry.line_odometry import RegistrationCounts
from slam.odometry.wheel_calibration import Calibration
from slam.trust.monitor import Trust
from slam.trust.nis import NisSummary


@dataclass(frozen=True, slots=True)
class StageTime:
    """Time of one stage of the pipeline over all its calls [ms]."""

    mean_ms: float
    p95_ms: float
    max_ms: float

    @classmethod
    def of(cls, seconds: list[float]) -> "StageTime":
        """Summarise durations [s]; zeros where there are none."""
        if not seconds:
            return cls(0.0, 0.0, 0.0)
        times = np.array(seconds) * 1e3
        return cls(float(times.mean()), float(np.percentile(times, 95)), float(times.max()))


@dataclass(frozen=True, slots=True)
class RunMetrics:
    """Figures of a run; ``records`` counts every stamped record, ``scans`` those with a scan.

    ``wheels`` are the systematic errors of the wheels, None where no scan is compared with them; ``noise`` is what the
    scans show of the noise of their scanner, None without scans.
    """

    scans: int
    records: int
    duration_s: float
    wall_s: float
    times_real_time: float
    peak_memory_mb: float | None
    landmarks: int
    key_frames: int
    registrations: RegistrationCounts
    wheels: Calibration | None
    observations: ObservationCounts
    landmark_life: LandmarkCounts
    closures: LoopCounts
    noise: NoiseSummary | None
    nis: NisSummary | None
    trust: Trust
    stages: dict[str, StageTime]
    graph_converged: bool
    interrupted: bool
    ate_rmse_m: float | None = None
    landmark_rmse_m: float | None = None

    def to_dict(self) -> dict[str, object]:
        """Plain dictionary for JSON, without what was not evaluated."""
        return {key: value for key, value in asdict(self).items() if value is not None}
