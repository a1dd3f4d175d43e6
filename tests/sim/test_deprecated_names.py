"""Names of the package's interface that have changed: the old ones work, with a warning."""

import pytest

import sim


def test_the_old_name_of_a_true_trajectory_still_works() -> None:
    with pytest.warns(DeprecationWarning, match=r"sim\.TrueTrajectory"):
        assert sim.Trajectory is sim.TrueTrajectory


def test_a_name_that_never_was_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="nonsense"):
        sim.nonsense  # noqa: B018
