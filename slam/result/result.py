"""What a run yields: trajectories, the landmark map, the walls as seen and the figures of the run."""

import csv
import io
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from features.se2 import Array
from features.signature import Kind, Signatures
from slam.config import SlamConfig
from slam.filter.association import ObservationCounts
from slam.filter.landmark_table import LandmarkCounts
from slam.loop.rules import LoopCounts
from slam.odometry.line_odometry import RegistrationCounts
from slam.odometry.wheel_calibration import Calibration
from slam.result.trajectory import Trajectory
from slam.trust.monitor import Trust
from slam.trust.nis import NisSummary


@dataclass(frozen=True, slots=True, eq=False)
class LandmarkMap:
    """Corners of the building, or other points, world frame.

    Parameters
    ----------
    ids : shape (n,).
    positions : shape (n, 2) [m].
    covs : shape (n, 2, 2) [m^2].
    observations : times each was observed, shape (n,).
    signatures : of the corners or points, shape (n,).
    identities : by which the source knows each, -1 for none, shape (n,).
    """

    ids: NDArray[np.int64]
    positions: Array
    covs: Array
    observations: NDArray[np.int64]
    signatures: Signatures
    identities: NDArray[np.int64]

    @property
    def points(self) -> NDArray[np.bool_]:
        """Whether each is a point that is no corner, shape (n,)."""
        return self.signatures.kinds == Kind.POINT

    @property
    def convex(self) -> NDArray[np.bool_]:
        """Whether each is a convex corner, shape (n,)."""
        return self.signatures.kinds == Kind.CONVEX

    @property
    def opening_angles(self) -> Array:
        """Angles between the two walls, shape (n,); NaN for a point that is no corner [rad]."""
        return self.signatures.opening_angles

    def __len__(self) -> int:
        return self.ids.size

    def to_csv(self) -> str:
        """Table with one landmark a line, metres and degrees."""
        text = io.StringIO()
        table = csv.writer(text, lineterminator="\n")
        table.writerow(
            ["id", "x", "y", "cov_xx", "cov_xy", "cov_yy", "observations", "kind", "opening_angle_deg", "identity"],
        )
        for k in range(len(self)):
            x, y = self.positions[k]
            cov = self.covs[k]
            table.writerow(
                [
                    self.ids[k],
                    f"{x:.6f}",
                    f"{y:.6f}",
                    f"{cov[0, 0]:.6e}",
                    f"{cov[0, 1]:.6e}",
                    f"{cov[1, 1]:.6e}",
                    self.observations[k],
                    Kind(self.signatures.kinds[k]).name.lower(),
                    "" if self.points[k] else f"{np.degrees(self.opening_angles[k]):.2f}",
                    "" if self.identities[k] < 0 else self.identities[k],
                ]
            )
        return text.getvalue()


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

    ``wheels`` is what they tell wrongly, None where no scan is compared with them.
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


@dataclass(frozen=True, slots=True, eq=False)
class SlamResult:
    """Everything that a run knows at its end, world frame.

    Parameters
    ----------
    trajectory : final pose of every record.
    trajectory_online : pose of the filter at each scan, as it was known at the time.
    trajectory_odometry : pose of every record by odometry alone, as configured, without landmarks.
    wheel_odometry : what the log says of the pose of every record.
    landmarks : the map.
    walls : lines seen from the key frames, ends, shape (n, 2, 2) [m].
    points : scan points of the key frames, shape (m, 2) [m].
    metrics : figures of the run.
    config : what the run was configured with.
    """

    trajectory: Trajectory
    trajectory_online: Trajectory
    trajectory_odometry: Trajectory
    wheel_odometry: Trajectory
    landmarks: LandmarkMap
    walls: Array
    points: Array
    metrics: RunMetrics
    config: SlamConfig
