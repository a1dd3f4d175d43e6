"""The outlier filter follows what changes slowly, rejects what jumps, and accepts a jump that lasts."""

from drivers.rplidar.codecs.outlier_filter import OutlierFilter


def accepted(values):
    outliers = OutlierFilter()
    return [outliers.accepts(value) for value in values]


def test_values_within_half_of_the_mean_are_accepted():
    for value, within in [(1.0, True), (1.49, True), (0.51, True), (1.51, False), (0.49, False)]:
        assert accepted([1.0, 1.0, value]) == [True, True, within]


def test_a_value_that_grows_slowly_is_followed_wherever_it_goes():
    """By 2 % a step to the fiftyfold: the mean lags some ten steps behind."""
    assert all(accepted([1.02**k for k in range(200)]))
    assert all(accepted([1.02**-k for k in range(200)]))


def test_the_third_outlier_in_a_row_is_accepted_as_the_new_mean():
    assert accepted([1.0, 4.0, 4.0, 4.0, 4.0, 1.0]) == [True, False, False, True, True, False]


def test_fewer_outliers_in_a_row_are_never_accepted():
    assert accepted([1.0, 4.0] * 10) == [True, False] * 10
    assert accepted([1.0, 4.0, 4.0] * 10) == [True, False, False] * 10
