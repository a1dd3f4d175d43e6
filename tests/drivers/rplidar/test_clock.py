import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from drivers.rplidar.clock import SampleClock

PERIOD, SAMPLES, WIRE = 108e-6, 40, 84 * 10 / 256000
PACKET = PERIOD * SAMPLES


def sample_times(seed, delay, count=200, drift=0.0):
    """Times of the samples of packets that come late by a random delay, on the average this long [s], and the truth."""
    rng, clock, found = np.random.default_rng(seed), SampleClock(PERIOD, SAMPLES, WIRE), []
    for k in range(count):
        sent = 100.0 + (k + 1) * PACKET * (1.0 + drift) - 0.5 * PERIOD + PERIOD + WIRE
        clock.arrive(k, sent + rng.exponential(delay))
        found.append(clock.times(k, SAMPLES))
    return np.concatenate(found), 100.0 + PERIOD * (1.0 + drift) * np.arange(count * SAMPLES)


@given(st.integers(0, 2**32 - 1))
def test_times_are_exact_where_nothing_delays(seed):
    """To the resolution of a double at 100 s."""
    found, true = sample_times(seed, 0.0)
    np.testing.assert_allclose(found, true, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_random_delays_average_out(seed):
    """The least of 100 delays of 5 ms on the average is 0.05 ms; ten times this comes once in 10^4.3."""
    found, true = sample_times(seed, 5e-3)
    late = (found - true)[100 * SAMPLES :]
    assert late.min() > -1e-9
    assert late.max() < 1e-3


@given(st.integers(0, 2**32 - 1), st.floats(-1e-3, 1e-3))
def test_a_clock_of_the_scanner_that_goes_wrong_does_not_add_up(seed, drift):
    """0.1 % over the half second of the window, and what the delays add."""
    found, true = sample_times(seed, 1e-3, 500, drift)
    assert np.abs(found - true)[100 * SAMPLES :].max() < 0.5e-3 + 0.5e-3


@given(st.lists(st.tuples(st.integers(0, 5), st.floats(-1.0, 1.0)), min_size=1, max_size=30))
def test_times_never_go_back(arrivals):
    clock, packet, last = SampleClock(PERIOD, SAMPLES, WIRE), 0, -np.inf
    for step, time in arrivals:
        if step == 0:
            clock.reset()
        packet += step
        clock.arrive(packet, 10.0 + time)
        times = clock.times(packet, SAMPLES)
        assert (np.diff(times, prepend=last) >= 0.0).all()
        last = times[-1]


def test_bytes_held_back_for_seconds_keep_their_times():
    """A host that does not read for 2 s gets all packets at once."""
    clock = SampleClock(PERIOD, SAMPLES, WIRE)
    delay = WIRE + PERIOD * 0.5
    for k in range(100):
        clock.arrive(k, (k + 1) * PACKET + delay)
        clock.times(k, SAMPLES)
    clock.arrive(560, 561 * PACKET + delay)
    np.testing.assert_allclose(clock.times(100, SAMPLES), PERIOD * (4000 + np.arange(40)), atol=1e-9)
