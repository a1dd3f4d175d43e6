"""The stream of a scan, cut anywhere, with damage of each kind."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from rplidar_streams import stream

from drivers.rplidar import FORMATS, Answer, Join, SampleDecoder, Samples, encode_dense, encode_hq
from drivers.rplidar.codecs.framing import BLOCK

answers = st.sampled_from(list(FORMATS))
seeds = st.integers(0, 2**32 - 1)

PACKETS = dict.fromkeys(FORMATS, 8) | {Answer.STANDARD: 60}
"""Enough of each to find one's way back and go on."""


def ranges_of(batches):
    return np.concatenate([np.empty(0), *(samples.ranges for samples in batches)])


def joined(batches):
    """Samples of batches that follow each other."""
    names = ("angles_clockwise", "ranges", "qualities", "starts", "packets")
    return Samples(*(np.concatenate([getattr(batch, name) for batch in batches]) for name in names))


def whole(answer, packets):
    """Samples of packets that nothing is wrong with."""
    batches = SampleDecoder(answer).feed(b"".join(packets))
    assert [batch.join for batch in batches[1:]] == [Join.FOLLOWS] * (len(batches) - 1)
    return joined(batches)


def damaged(answer, data):
    decoder = SampleDecoder(answer)
    return decoder, decoder.feed(data)


@pytest.mark.slow
@given(answers, seeds, st.floats(0.0, 359.0), st.floats(0.05, 3.0), st.data())
def test_samples_are_the_same_however_the_bytes_are_cut(answer, seed, first_deg, step_deg, data):
    sent = stream(answer, PACKETS[answer], np.random.default_rng(seed), first_deg=first_deg, step_deg=step_deg)
    at_once = whole(answer, sent.packets)
    content, decoder, batches, at = b"".join(sent.packets), SampleDecoder(answer), [], 0
    while at < len(content):
        size = data.draw(st.integers(1, 2 * FORMATS[answer].size))
        batches += decoder.feed(content[at : at + size])
        at += size
    for name in ("angles_clockwise", "ranges", "qualities", "starts", "packets"):
        assert_array_equal(np.concatenate([getattr(batch, name) for batch in batches]), getattr(at_once, name))
    assert [batch.join for batch in batches] == [Join.RESTART] + [Join.FOLLOWS] * (len(batches) - 1)
    kept = len(sent.packets) - FORMATS[answer].pending
    assert len(at_once) == kept * FORMATS[answer].samples
    assert at_once.packets[-1] == kept - 1
    assert decoder.counts.dropped_bytes == 0


@pytest.mark.parametrize("answer", FORMATS)
def test_each_revolution_starts_once(answer):
    """Turns of 900 samples, of which each capsule knows its start angle to 1/64 deg only."""
    rng = np.random.default_rng(0)
    samples = whole(answer, stream(answer, 9000 // FORMATS[answer].samples, rng, first_deg=10.2, step_deg=0.4).packets)
    found = samples.starts.nonzero()[0]
    expected = np.arange(875, len(samples), 900)
    assert np.abs(found - expected).max() <= 1


@given(answers, st.binary(max_size=400), seeds)
def test_a_valid_stream_behind_any_bytes_is_decoded_within_two_packets(answer, noise, seed):
    sent = stream(answer, PACKETS[answer], np.random.default_rng(seed))
    expected = whole(answer, sent.packets).ranges[2 * FORMATS[answer].samples :]
    _, batches = damaged(answer, noise + b"".join(sent.packets))
    found = ranges_of(batches)
    assert_array_equal(found[-len(expected) :], expected)


@given(answers, st.binary(max_size=3000))
def test_any_bytes_may_come(answer, noise):
    decoder, batches = damaged(answer, noise)
    for samples in batches:
        assert (samples.ranges >= 0.0).all()
        assert np.isfinite(samples.angles_clockwise).all()
    assert decoder.counts.dropped_bytes + decoder.counts.packets * FORMATS[answer].size <= len(noise)


@pytest.mark.parametrize("answer", [answer for answer in FORMATS if answer is not Answer.STANDARD])
@given(seed=seeds, data=st.data())
def test_a_flipped_bit_costs_one_packet(answer, seed, data):
    """And of a capsule the one before it, whose angles it would have told."""
    sent = stream(answer, 8, np.random.default_rng(seed))
    at = data.draw(st.integers(0, FORMATS[answer].size - 1))
    packet = bytearray(sent.packets[4])
    packet[at] ^= 1 << data.draw(st.integers(0, 7))
    good = whole(answer, sent.packets)
    decoder, batches = damaged(answer, b"".join([*sent.packets[:4], bytes(packet), *sent.packets[5:]]))
    kept = (good.packets < 4 - FORMATS[answer].pending) | (good.packets > 4)
    assert_array_equal(ranges_of(batches), good.ranges[kept])
    assert [batch.join for batch in batches] == [Join.RESTART, Join.GAP]
    assert decoder.counts.dropped_bytes == FORMATS[answer].size
    begins_as_one = packet[0] == 0xA5 if answer is Answer.HQ else (packet[0] >> 4, packet[1] >> 4) == (0xA, 0x5)
    assert decoder.counts.checksum_errors == begins_as_one
    assert decoder.counts.discontinuities == 0  # a gap of which the bytes tell is no second one by the angle


@pytest.mark.parametrize("answer", [answer for answer in FORMATS if answer is not Answer.STANDARD])
@given(seed=seeds, data=st.data())
def test_an_intact_packet_amid_damage_counts_only_where_another_follows(answer, seed, data):
    """Eight bits of a checksum are right by chance; here the bytes of two packets hold one that is not in its place."""
    sent, size = stream(answer, 8, np.random.default_rng(seed)), FORMATS[answer].size
    shift = data.draw(st.integers(1, size - 1))
    damage = bytes(shift) + sent.packets[7] + bytes(size - shift)
    good = whole(answer, sent.packets)
    decoder, batches = damaged(answer, b"".join([*sent.packets[:4], damage, *sent.packets[4:]]))
    kept = (good.packets < 4 - FORMATS[answer].pending) | (good.packets >= 4)
    assert_array_equal(ranges_of(batches), good.ranges[kept])
    assert (decoder.counts.packets, decoder.counts.dropped_bytes) == (8, 2 * size)


@given(answers, seeds, st.data())
def test_lost_bytes_cost_the_packets_that_lack_them(answer, seed, data):
    sent = stream(answer, PACKETS[answer], np.random.default_rng(seed))
    content, size, pending = b"".join(sent.packets), FORMATS[answer].size, FORMATS[answer].pending
    middle = len(sent.packets) // 2
    at = middle * size + data.draw(st.integers(0, size - 1))
    count = data.draw(st.integers(1, size - 1))
    rest = content[:at] + content[at + count :]
    spliced = np.frombuffer(rest, FORMATS[answer].dtype, 1, middle * size)
    assume(answer is Answer.STANDARD or not FORMATS[answer].intact(spliced)[0])  # 8 bits fit by chance
    decoder, batches = damaged(answer, rest)
    good, found = whole(answer, sent.packets), ranges_of(batches)
    last = (at + count - 1) // size
    margin = pending if answer is Answer.STANDARD else 0  # nodes on either side of a loss may fit either way
    before = good.ranges[good.packets < middle - pending]
    behind = good.ranges[good.packets > last + margin]
    assert_array_equal(found[: len(before)], before)
    assert_array_equal(found[len(found) - len(behind) :], behind)
    assert len(found) <= len(good)
    assert decoder.counts.packets * size + decoder.counts.dropped_bytes <= len(rest)


@given(seeds, st.integers(0, 2))
def test_a_node_with_a_wrong_check_bit_costs_itself_alone(seed, which):
    sent = stream(Answer.STANDARD, 60, np.random.default_rng(seed))
    content = bytearray(b"".join(sent.packets))
    content[30 * 5 + (which == 2)] ^= (1, 2, 1)[which]
    decoder, batches = damaged(Answer.STANDARD, bytes(content))
    assert_array_equal(ranges_of(batches), np.delete(sent.ranges[:-8], 30))
    assert decoder.counts.dropped_bytes == 5


@pytest.mark.parametrize("lost", [1, 2, 5])
def test_a_lost_capsule_is_noticed_by_the_angle(lost):
    sent = stream(Answer.DENSE, 60, np.random.default_rng(0))
    good = whole(Answer.DENSE, sent.packets)
    decoder, batches = damaged(Answer.DENSE, b"".join(sent.packets[:30] + sent.packets[30 + lost :]))
    assert_array_equal(ranges_of(batches), good.ranges[(good.packets < 29) | (good.packets >= 30 + lost)])
    assert decoder.counts.discontinuities == 1
    assert [batch.join for batch in batches] == [Join.RESTART, Join.GAP]


@pytest.mark.parametrize("answer", FORMATS)
def test_the_begin_of_a_revolution_in_lost_packets_is_made_up_for(answer):
    """A turn has 900 samples; some packets about the first of three begins are lost, and a byte of the next."""
    turn = round(900 / FORMATS[answer].samples)
    sent = stream(answer, 3 * turn + 1, np.random.default_rng(0), first_deg=0.1)
    assert whole(answer, sent.packets).starts.sum() == 2
    _, batches = damaged(
        answer, b"".join([*sent.packets[: turn - 3], sent.packets[turn + 3][1:], *sent.packets[turn + 4 :]])
    )
    assert Join.GAP in {batch.join for batch in batches}
    assert joined(batches).starts.sum() == 2


def test_a_slower_or_faster_turn_is_believed_after_a_while():
    rng = np.random.default_rng(0)
    slow, fast = (stream(Answer.DENSE, 20, rng, step_deg=step).packets for step in (0.2, 0.8))
    decoder = SampleDecoder(Answer.DENSE)
    decoder.feed(b"".join(slow))
    fast = [encode_dense(np.radians(160.0 + 32.0 * k), np.ones(40)) for k in range(20)]
    found = ranges_of(decoder.feed(b"".join(fast)))
    assert found.size >= 40 * (len(fast) - 4)


def test_a_restart_drops_the_capsule_that_waits():
    rng = np.random.default_rng(0)
    before, behind = (stream(Answer.DENSE, 5, rng, first_deg=first) for first in (0.0, 200.0))
    decoder, batches = damaged(Answer.DENSE, b"".join(before.packets + behind.packets))
    assert_array_equal(ranges_of(batches), np.concatenate([before.ranges[:160], behind.ranges[:160]]))
    assert [batch.join for batch in batches] == [Join.RESTART, Join.RESTART]
    assert not any(batch.starts.any() for batch in batches)
    assert decoder.counts.restarts == 1


@pytest.mark.parametrize("answer", FORMATS)
def test_blocks_of_the_framer_leave_no_seam(answer):
    rng = np.random.default_rng(0)
    count = 2 * BLOCK // FORMATS[answer].size + 20
    packets = stream(answer, min(count, 400), rng).packets
    data = b"".join(packets * (count // len(packets) + 1))
    decoder, batches = damaged(answer, data)
    assert decoder.counts.packets * FORMATS[answer].size + decoder.counts.dropped_bytes == len(data) - (
        5 * 8 if answer is Answer.STANDARD else 0
    )
    assert decoder.counts.dropped_bytes == 0
    assert len(batches) >= 2


@pytest.mark.parametrize("answer", [answer for answer in FORMATS if FORMATS[answer].measure is not None])
def test_a_revolution_that_starts_with_a_capsule_is_noticed_however_the_bytes_come(answer):
    """The last sample before it came with another feed, and its angle is told by what lies between two capsules."""
    samples, step = FORMATS[answer].samples, 0.4
    first = 360.0 + 0.5 * step - 2.0 * step * samples
    sent = stream(answer, 6, np.random.default_rng(0), first_deg=first, step_deg=step)
    decoder = SampleDecoder(answer)
    one_by_one = joined([batch for packet in sent.packets for batch in decoder.feed(packet)])
    for found in (whole(answer, sent.packets), one_by_one):
        assert found.starts.nonzero()[0].tolist() == [2 * samples]


def test_a_scanner_that_does_not_turn_starts_no_revolution():
    decoder = SampleDecoder(Answer.DENSE)
    batches = decoder.feed(b"".join(encode_dense(np.radians(30.0), np.ones(40)) for _ in range(5)))
    assert len(joined(batches)) == 4 * 40
    assert not joined(batches).starts.any()


@pytest.mark.parametrize(("back_deg", "started"), [(5.0, False), (20.0, True)])
def test_behind_a_gap_a_revolution_starts_where_the_angle_is_smaller_by_more_than_an_optical_offset(back_deg, started):
    """Angles of a triangulating scanner go back a little where the range grows, within a revolution."""

    def packet(first_deg):
        angles = np.radians(first_deg + 0.2 * np.arange(96))
        return encode_hq(angles, np.ones(96), np.full(96, 40, np.uint8), np.zeros(96, np.bool_))

    last_deg = 100.0 + 0.2 * 95
    lost = bytearray(packet(120.0))
    lost[20] ^= 1
    batches = SampleDecoder(Answer.HQ).feed(packet(100.0) + bytes(lost) + packet(last_deg - back_deg))
    assert [batch.join for batch in batches] == [Join.RESTART, Join.GAP]
    assert joined(batches).starts.nonzero()[0].tolist() == [96] * started


def test_a_scanner_that_begins_again_at_another_speed_is_believed_at_once():
    rng = np.random.default_rng(0)
    slow, fast = (stream(Answer.DENSE, 8, rng, step_deg=step) for step in (0.2, 0.8))
    decoder, batches = damaged(Answer.DENSE, b"".join([*slow.packets, *fast.packets]))
    assert_array_equal(ranges_of(batches), np.concatenate([slow.ranges[: 7 * 40], fast.ranges[: 7 * 40]]))
    assert decoder.counts.discontinuities == 0
    assert decoder.counts.restarts == 1
