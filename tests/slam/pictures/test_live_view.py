import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from features.se2 import rotation
from sim import room_run
from slam.config_file import load_config
from slam.errors import ViewError
from slam.pictures.live_view import LiveView, ring
from slam.pipeline import Slam


@given(st.floats(1e-4, 1.0), st.floats(1e-4, 1.0), st.floats(-3.0, 3.0))
def test_ring_lies_two_sigmas_about_the_origin(sigma_a, sigma_b, angle):
    turn = rotation(angle)
    cov = turn @ np.diag([sigma_a**2, sigma_b**2]) @ turn.T
    points = ring(cov)
    distances2 = np.einsum("ni,ij,nj->n", points, np.linalg.inv(cov), points)
    assert distances2 == pytest.approx(np.full(len(points), 4.0), rel=1e-6)


@pytest.mark.slow
def test_file_of_the_view_grows_with_the_run(tmp_path):
    file = tmp_path / "way" / "view.rrd"
    source = room_run(1)
    slam = Slam(load_config(None, source=source.info))
    view = LiveView("room", slam, file)
    for _, frame in zip(range(60), source, strict=False):
        view.show(frame, slam.process(frame))
    view.close()
    assert file.read_bytes().startswith(b"RRF2")
    assert file.stat().st_size > 20_000


def test_file_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ViewError, match="cannot be written"):
        LiveView("room", Slam(load_config(None)), tmp_path / "file" / "view.rrd")
