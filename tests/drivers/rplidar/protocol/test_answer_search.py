import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from rplidar_streams import stream

from drivers.rplidar import Answer, AnswerSearch, Descriptor, Health

INFO = Descriptor(20, False, Answer.INFO)
payloads = st.binary(min_size=20, max_size=20)


@given(payloads, st.data())
def test_an_answer_is_found_however_the_bytes_are_cut(payload, data):
    content, search, at = INFO.pack() + payload + b"rest", AnswerSearch({Answer.INFO: 20}), 0
    while at < len(content):
        size = data.draw(st.integers(1, len(content) - at))
        there = search.feed(content[at : at + size])
        at += size
        assert there == (at >= 27)
    assert (search.descriptor, search.payload) == (INFO, payload)
    assert search.skipped == b""


@given(st.integers(0, 2**32 - 1), st.integers(0, 83), payloads)
def test_samples_of_an_earlier_scan_are_passed_over(seed, cut, payload):
    stale = b"".join(stream(Answer.DENSE, 5, np.random.default_rng(seed)).packets)[cut:]
    search = AnswerSearch({Answer.INFO: 20})
    assert search.feed(stale + INFO.pack() + payload)
    assert search.payload == payload
    assert search.skipped == stale


def test_answers_to_other_requests_and_boot_messages_are_passed_over():
    search = AnswerSearch({Answer.INFO: 20})
    banner = b"RP LIDAR System.\r\nFirmware Ver 1.29\r\nCopyright\r\n\xa5"
    other = Descriptor(3, False, Answer.HEALTH).pack() + Health(0).pack()
    false = Descriptor(2**30 - 1, False, Answer.INFO).pack() + Descriptor(20, True, Answer.INFO).pack()
    assert search.feed(banner + other + false + INFO.pack() + bytes(20))
    assert search.payload == bytes(20)


def test_a_stream_is_there_with_its_descriptor_and_its_first_bytes_are_kept():
    search = AnswerSearch({Answer.STANDARD: 5, Answer.DENSE: 84}, multiple=True)
    assert search.feed(b"\0" + Descriptor(84, True, Answer.DENSE).pack() + b"\xa0\x58")
    assert (search.descriptor, search.payload, search.rest) == (Descriptor(84, True, Answer.DENSE), b"", b"\xa0\x58")


@given(st.binary(max_size=500))
def test_any_bytes_may_come(noise):
    search = AnswerSearch({Answer.LIDAR_CONF: None})
    if not search.feed(noise):
        assert search.rest == b""
        assert noise.startswith(search.skipped)
