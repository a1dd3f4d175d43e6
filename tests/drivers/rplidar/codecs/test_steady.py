"""A value that changes slowly is told from one that jumps, and a jump that lasts is believed."""

from drivers.rplidar.codecs.steady import Steady


def judged(values):
    steady = Steady()
    return [steady.agrees(value) for value in values]


def test_values_agree_to_within_half_of_the_mean():
    for value, agrees in [(1.0, True), (1.49, True), (0.51, True), (1.51, False), (0.49, False)]:
        assert judged([1.0, 1.0, value]) == [True, True, agrees]


def test_a_value_that_grows_slowly_is_followed_wherever_it_goes():
    """By 2 % a step to the fiftyfold: the mean lags some ten steps behind."""
    assert all(judged([1.02**k for k in range(200)]))
    assert all(judged([1.02**-k for k in range(200)]))


def test_the_third_jump_in_a_row_is_believed_and_from_then_on_its_value():
    assert judged([1.0, 4.0, 4.0, 4.0, 4.0, 1.0]) == [True, False, False, True, True, False]


def test_single_jumps_among_values_that_agree_are_never_believed():
    assert judged([1.0, 4.0] * 10) == [True, False] * 10
    assert judged([1.0, 4.0, 4.0] * 10) == [True, False, False] * 10
