import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.rplidar.scan_queue import ScanQueue
from features.scan import LaserScan


def scan(stamp):
    return LaserScan(np.ones(1), np.zeros(1), float(stamp))


@given(st.integers(1, 5), st.lists(st.booleans()))
def test_the_oldest_make_room_and_are_counted(capacity, steps):
    queue, held, dropped = ScanQueue(capacity), [], 0
    for k, put in enumerate(steps):
        if put:
            queue.put(scan(k))
            held.append(k)
            dropped += len(held) > capacity
            held = held[-capacity:]
        else:
            taken = queue.take(0.0)
            assert (None if taken is None else taken.stamp) == (held.pop(0) if held else None)
    assert queue.dropped == dropped


def test_at_the_end_the_rest_comes_first():
    queue = ScanQueue(3)
    queue.put(scan(1))
    queue.end()
    taken = queue.take(None)
    assert taken is not None
    assert taken.stamp == 1.0
    assert queue.take(None) is None


def test_a_failure_comes_after_the_rest():
    queue = ScanQueue(3)
    queue.put(scan(1))
    queue.end(OSError("full"))
    queue.end()
    assert queue.take(None) is not None
    with pytest.raises(OSError, match="full"):
        queue.take(None)


def test_a_queue_without_room_is_refused():
    with pytest.raises(ValueError, match="capacity is 0"):
        ScanQueue(0)
