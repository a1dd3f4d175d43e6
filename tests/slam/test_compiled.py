import logging

from numba import njit
from numba.core.event import install_listener

from slam.compiled import Notice


def test_compiling_is_said_once_and_calling_what_is_compiled_is_not(caplog):
    caplog.set_level(logging.INFO, "slam.compiled")

    @njit
    def double(x):
        return 2 * x

    @njit
    def square(x):
        return x * x

    double(1.0)
    with install_listener("numba:compile", Notice()):
        double(2.0)
        assert not caplog.records
        double(1)
        square(1)
    assert [record.levelname for record in caplog.records] == ["INFO"]
