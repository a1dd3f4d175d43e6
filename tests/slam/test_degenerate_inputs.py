"""Scans, features, records and sensors at the edge of what numbers can say: no NaN reaches an estimate."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import law

from drivers.frame import Frame, LandmarkObservations
from features.errors import CwlfError
from features.extraction import extract
from features.feature import Corners, Features, Lines
from features.scan import LaserScan
from features.se2 import Array, pose
from features.sensor import SensorModel
from sim.sensing.lidar import Lidar
from sim.worlds.built_in.demo_room import room
from slam.config import SlamConfig
from slam.pipeline import Slam

CONFIG = SlamConfig.of_preset("rplidar-s1")
ODD_SIGMAS_MM = [1e-3, 1.0, 300.0, 1e5]


def config_of(sigma_mm: float, source: str = "line-aided") -> SlamConfig:
    sensor = CONFIG.sensor.model_copy(update={"sigma_range_mm": sigma_mm})
    odometry = CONFIG.odometry.model_copy(update={"source": source})
    return CONFIG.model_copy(update={"sensor": sensor, "odometry": odometry})


def assert_finite_or_refused(slam: Slam, frames: Sequence[Frame]) -> int:
    """Process frames up to one that is refused with a sentence; all that was estimated is finite. Count them."""
    for count, frame in enumerate(frames):
        try:
            slam.process(frame)
        except (CwlfError, ValueError) as error:
            assert "finite" in str(error) or "positive definite" in str(error)  # noqa: PT017, one of several frames
            return count
        assert np.isfinite(slam.pose).all()
        assert np.isfinite(slam.filter.P).all()
        assert np.isfinite(slam.landmarks).all()
    return len(frames)


def room_frames(count: int = 3) -> list[Frame]:
    scanner, rng = Lidar.of_preset("rplidar-s1"), np.random.default_rng(0)
    places = [pose(2.2 + 0.3 * k, 1.7, 0.2 * k) for k in range(count)]
    return [Frame(0.1 * k, place, scanner.scan(room(), place, 0.1 * k, rng)) for k, place in enumerate(places)]


def spoilt(features: Features, change: Callable[[Features], None]) -> Features:
    """Features of which the first line and the first corner, if there are any, are changed."""
    own = Features(Lines(features.lines.records.copy()), Corners(features.corners.records.copy()))
    change(own)
    return own


def with_cov(cov: Sequence[Sequence[float]]) -> Callable[[Features], None]:
    def change(features: Features) -> None:
        features.lines.covs[:1] = features.corners.covs[:1] = cov

    return change


def with_params(value: float) -> Callable[[Features], None]:
    def change(features: Features) -> None:
        features.lines.params[:1] = features.corners.positions[:1] = value

    return change


def of_no_length(features: Features) -> None:
    features.lines.ends[:1, 1] = features.lines.ends[:1, 0]


def with_an_end_nowhere(features: Features) -> None:
    features.lines.ends[:1, 1] = math.nan


@pytest.mark.parametrize(
    "change",
    [
        with_cov([[0.0, 0.0], [0.0, 0.0]]),
        with_cov([[0.0, 0.0], [0.0, 1e-4]]),
        with_cov([[1e-4, 1e-4], [1e-4, 1e-4]]),
        with_cov([[2.1476105619742395e34, 2.603085933105164e34], [2.603085933105164e34, 3.1551606679103595e34]]),
        with_cov([[math.nan, 0.0], [0.0, 1e-4]]),
        with_cov([[math.inf, 0.0], [0.0, 1e-4]]),
        with_cov([[-1e-4, 0.0], [0.0, 1e-4]]),
        with_params(math.nan),
        with_params(math.inf),
        of_no_length,
        with_an_end_nowhere,
    ],
)
@pytest.mark.parametrize("source", ["line-aided", "lines", "wheel"])
def test_a_line_or_corner_that_is_not_determined_does_no_harm(change: Callable[[Features], None], source: str) -> None:
    def extractor(scan: LaserScan, sensor: SensorModel) -> Features:
        return spoilt(extract(scan, sensor), change)

    frames = room_frames()
    slam = Slam(config_of(10.0, source), extractor=extractor)
    assert assert_finite_or_refused(slam, frames) == len(frames)
    assert slam.finish().metrics.scans == len(frames)


def diverging_scan() -> LaserScan:
    """A scan of which a fit with 300 mm of noise does not converge: its covariance is singular."""
    rng, sensor = np.random.default_rng(0), SensorModel(0.3, 1e-3, 0.01, 100.0)
    while True:
        count = int(rng.integers(3, 60))
        angles = np.linspace(0.0, rng.uniform(0.01, 1.0), count)
        scan = LaserScan(np.abs(rng.uniform(0.05, 3.0) + rng.normal(0.0, 0.3, count)), angles)
        covs = extract(scan, sensor).lines.covs
        if (covs[:, 0, 0] * covs[:, 1, 1] - covs[:, 0, 1] ** 2 <= 0.0).any():
            return scan


@pytest.mark.parametrize("source", ["line-aided", "lines"])
def test_a_short_wall_without_a_direction_does_not_end_a_run(source: str) -> None:
    scan = diverging_scan()
    slam = Slam(config_of(300.0, source))
    frames = [Frame(0.1 * k, pose(), replace(scan, stamp=0.1 * k)) for k in range(5)]
    assert assert_finite_or_refused(slam, frames) == len(frames)


ODD_RANGES = st.sampled_from([0.0, 5e-324, 1e-12, 0.1, 0.5, 0.5, 1.0, 1.0, 1.0, 2.0, 39.99, 1e200, math.inf])
ODD_ANGLES = st.sampled_from([-math.pi, -1.0, 0.0, 1e-300, 1e-9, 0.01, 0.02, 0.03, 0.04, 1.0, math.pi, 7.0, 1e9, 1e300])
ODD_TIMES = st.sampled_from([-1e3, -0.1, 0.0, 1e-300, 0.05, 1e3])
ODD_POSES = st.sampled_from([0.0, 0.0, 1e-300, 0.01, 0.1, 1.0, 1e3])


@st.composite
def odd_scans(draw: st.DrawFn) -> LaserScan:
    """Scans with steps, repeated beams, no returns and beams at any time, among them straight and round walls."""
    count = draw(st.integers(0, 40))
    kind = draw(st.sampled_from(["any", "arc", "wall"]))
    if kind == "any":
        angles = np.array(draw(st.lists(ODD_ANGLES, min_size=count, max_size=count)))
        ranges = np.array(draw(st.lists(ODD_RANGES, min_size=count, max_size=count)))
    else:
        angles = np.linspace(0.0, draw(st.sampled_from([1e-9, 1e-3, 0.5, 1.4])), count)
        reach = draw(st.sampled_from([1e-9, 0.1, 1.0, 30.0]))
        ranges = np.full(count, reach) if kind == "arc" else reach / np.cos(angles)
    times = np.array(draw(st.lists(ODD_TIMES, min_size=count, max_size=count))) if draw(st.booleans()) else None
    return LaserScan(ranges, angles, 0.0, times)


@pytest.mark.slow
@law
@given(
    st.lists(st.tuples(odd_scans(), st.tuples(ODD_POSES, ODD_POSES, ODD_POSES)), min_size=2, max_size=5),
    st.sampled_from(ODD_SIGMAS_MM),
    st.sampled_from([1e-6, 0.1, 90.0]),
    st.sampled_from(["line-aided", "lines", "wheel"]),
    st.sampled_from([0.0, 1e-300, 0.1, 1e3]),
)
def test_odd_scans_and_records_give_finite_estimates_or_a_sentence(
    records: list[tuple[LaserScan, tuple[float, float, float]]],
    sigma_mm: float,
    sigma_deg: float,
    source: str,
    interval: float,
) -> None:
    config = config_of(sigma_mm, source)
    sensor = config.sensor.model_copy(update={"sigma_bearing_deg": sigma_deg})
    slam = Slam(config.model_copy(update={"sensor": sensor}))
    frames = [
        Frame(k * interval, np.array(place), replace(scan, stamp=k * interval))
        for k, (scan, place) in enumerate(records)
    ]
    assert_finite_or_refused(slam, frames)


def covs_of(sigma: float, correlation: float) -> Array:
    return sigma**2 * np.array([[[1.0, correlation], [correlation, 1.0]]])


@law
@given(
    st.sampled_from([1e-300, 1e-9, 1.0, 19.9]),
    st.sampled_from([1e-150, 1e-8, 0.1, 1e8, 1e150]),
    st.sampled_from([0.0, 0.9, 1.0 - 1e-15]),
    st.booleans(),
)
def test_odd_observations_give_finite_estimates_or_a_sentence(
    distance: float, sigma: float, correlation: float, named: bool
) -> None:
    config = SlamConfig.of_preset("mrclam-camera")
    identities = np.array([3]) if named else None
    try:
        seen = LandmarkObservations(np.array([distance]), np.array([0.1]), covs_of(sigma, correlation), identities)
    except ValueError as error:
        assert "positive definite" in str(error)  # noqa: PT017, one of several inputs
        return
    frames = [Frame(0.1 * k, pose(0.2 * k, 0.0, 0.0), observations=seen) for k in range(4)]
    assert_finite_or_refused(Slam(config), frames)
