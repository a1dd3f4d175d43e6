"""Lists of edges as frames with observations."""

import numpy as np
import pytest

from drivers import LogFormatError, open_log
from drivers.data_sets.victoria_park import VictoriaPark

EDGES = """ODOMETRY 0 1 1.0 0.0 0.5 0.01 0 0 0.01 0 0.001
LANDMARK 1 7 3.0 4.0 0.4 0 0.1
ODOMETRY 1 3 1.0 0.0 0.0 0.01 0 0 0.01 0 0.001
"""


def test_poses_are_chained_and_landmarks_seen_from_them(tmp_path):
    path = tmp_path / "park.txt"
    path.write_text(EDGES)
    source = open_log(path)
    assert isinstance(source, VictoriaPark)
    frames = list(source)
    np.testing.assert_allclose(frames[2].pose_odom_robot, [1.0 + np.cos(0.5), np.sin(0.5), 0.5])
    assert [frame.observations is None for frame in frames] == [True, False, True]
    seen = frames[1].observations
    assert seen.identities.tolist() == [7]
    np.testing.assert_allclose([seen.ranges[0], seen.bearings[0]], [5.0, np.arctan2(4.0, 3.0)])
    # Back in the plane the covariance is that of the file.
    c, s, r = 0.6, 0.8, 5.0
    by_polar = np.array([[c, -r * s], [s, r * c]])
    np.testing.assert_allclose(by_polar @ seen.covs[0] @ by_polar.T, [[0.4, 0.0], [0.0, 0.1]], atol=1e-12)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("LANDMARK 3 7 x 4.0 0.4 0 0.1", "line 4: 'x' is no finite number"),
        ("LANDMARK 3 7 1.0", "line 4: 4 fields"),
        ("LANDMARK 1 7 3.0 4.0 0.4 0 0.1", "line 4: the edge is from pose 1: expected one from the newest, 3"),
        ("LANDMARK 3 7 3.0 4.0 0.4 0.4 0.1", "line 4: the covariance is not positive definite"),
        ("VERTEX 3 7", "line 4: 'VERTEX': expected ODOMETRY or LANDMARK"),
    ],
)
def test_a_bad_line_is_named(tmp_path, line, message):
    path = tmp_path / "park.txt"
    path.write_text(EDGES + line + "\n")
    with pytest.raises(LogFormatError, match=message):
        open_log(path)
