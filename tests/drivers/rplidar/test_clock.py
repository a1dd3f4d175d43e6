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
    """The estimate rises by 43 us a packet and falls with each that comes before it: some 1 ms of delays of 5 ms."""
    found, true = sample_times(seed, 5e-3)
    late = (found - true)[100 * SAMPLES :]
    assert late.min() > -1e-9
    assert late.max() < 4e-3
    assert late.mean() < 2e-3


@given(st.integers(0, 2**32 - 1), st.floats(-5e-3, 5e-3))
def test_a_clock_of_the_scanner_that_goes_wrong_does_not_add_up(seed, drift):
    """0.5 % are 10 ms in these 2 s."""
    found, true = sample_times(seed, 1e-3, 500, drift)
    assert np.abs(found - true)[100 * SAMPLES :].max() < 3e-3


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
    """A host that does not read for 2 s gets the packets of that time at once, some with each read."""
    clock = SampleClock(PERIOD, SAMPLES, WIRE)
    delay = WIRE + PERIOD * 0.5
    for k in range(560):
        there = min(k // 20 * 20 + 19, 559) if k >= 100 else k
        clock.arrive(there, ((560 if k >= 100 else k) + 1) * PACKET + delay)
        # 1 % of the 2 s at most.
        np.testing.assert_allclose(clock.times(k, SAMPLES), PERIOD * (SAMPLES * k + np.arange(SAMPLES)), atol=0.021)
