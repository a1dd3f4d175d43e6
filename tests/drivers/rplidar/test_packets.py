"""Encoding and decoding of each packet type, against golden bytes and each other."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from rplidar_streams import stream

from drivers.rplidar import (
    FORMATS,
    Answer,
    encode_dense,
    encode_express,
    encode_hq,
    encode_standard,
    encode_ultra,
    encode_ultra_dense,
    optical_offsets,
)
from drivers.rplidar.codecs.hq import crc32

TURN = 2.0 * np.pi
ROUNDING = 1e-12
"""A few units in the last place of an angle below 7 rad, or a range below 66 m."""

q6 = st.integers(0, 23039)


def whole(count, top):
    return hnp.arrays(np.int64, count, elements=st.integers(0, top))


def packets(answer, *data):
    return np.frombuffer(b"".join(data), FORMATS[answer].dtype)


def decoded(answer, *data, **given_before):
    read = packets(answer, *data)
    assert FORMATS[answer].intact(read).all()
    return FORMATS[answer].decode(read, **given_before)


def radians(steps_q6):
    return np.asarray(steps_q6) * TURN / 23040.0


def test_golden_node():
    node = encode_standard(np.radians([123.5]), np.array([2.50025]), np.array([47 << 2]), np.array([True]))
    assert node.hex() == "bdc13d1127"
    samples = decoded(Answer.STANDARD, bytes.fromhex("3e9b640000"))
    assert_allclose(np.degrees(samples.angles_clockwise), 201.2, atol=1.0 / 128.0)
    assert (samples.qualities.tolist(), samples.ranges.tolist(), samples.starts.tolist()) == ([15 << 2], [0.0], [False])


@pytest.mark.parametrize(("q6", "angle_deg"), [(23039, 23039 / 64.0), (23040, 0.0), (23104, 1.0)])
def test_an_angle_of_a_node_beyond_the_whole_turn_begins_anew(q6, angle_deg):
    """Its 15 bits hold up to 512 deg, and the device rounds up to 360."""
    node = bytes([0x3E]) + (q6 << 1 | 1).to_bytes(2, "little") + bytes(2)
    assert_allclose(decoded(Answer.STANDARD, node).angles_clockwise, np.radians(angle_deg), atol=1e-12)


def test_golden_dense_capsule():
    """Its ranges are little-endian: read big-endian, 1000 mm would be 59395."""
    capsule = encode_dense(0.0, np.ones(40), restart=True)
    assert capsule.hex().startswith("a0580080e803e803")
    assert_array_equal(decoded(Answer.DENSE, capsule, capsule).ranges, 1.0)


@given(st.integers(1, 50).flatmap(lambda n: st.tuples(*(whole(n, top) for top in (23039, 65535, 63, 1)))))
def test_standard_round_trip(content):
    angles, distances, qualities, starts = content
    data = encode_standard(radians(angles), distances / 4000.0, (qualities << 2).astype(np.uint8), starts.astype(bool))
    samples = decoded(Answer.STANDARD, data, first=7)
    assert_allclose(samples.angles_clockwise, radians(angles), atol=ROUNDING)
    assert_array_equal(samples.ranges, distances / 4000.0)
    assert_array_equal(samples.qualities, qualities << 2)
    assert_array_equal(samples.starts, starts)
    assert_array_equal(samples.packets, 7 + np.arange(len(angles)))


@given(whole(96, 65535), whole(96, 2**32 - 1), whole(96, 255), whole(96, 1), st.integers(0, 2**64 - 1))
def test_hq_round_trip(angles, distances, qualities, starts, time):
    data = encode_hq(angles * TURN / 65536.0, distances / 4000.0, qualities, starts.astype(bool), time)
    samples = decoded(Answer.HQ, data)
    assert_allclose(samples.angles_clockwise, angles * TURN / 65536.0, atol=ROUNDING)
    assert_array_equal(samples.ranges, distances / 4000.0)
    assert_array_equal(samples.qualities, qualities)
    assert_array_equal(samples.starts, starts)
    assert packets(Answer.HQ, data)["time"][0] == time


@pytest.mark.parametrize(("size", "padding"), [(777, 3), (776, 4), (775, 1), (774, 2)])
def test_crc_of_hq_pads_by_four_where_nothing_is_left_over(size, padding):
    data = bytes(range(256)) * 3 + bytes(size - 768)
    assert crc32(data) == zlib.crc32(data + bytes(padding))


def encoder(start, following, count):
    """Encoder angles of a capsule by the formula of the protocol, 64ths of a degree."""
    return (start + (following - start) % 23040 * np.arange(count) / count) % 23040


def angle_distance(a, b):
    return np.abs((a - b + np.pi) % TURN - np.pi)


@given(q6, q6, whole(32, 16383), whole(32, 63))
def test_express_round_trip(start, following, distances, offsets):
    first = encode_express(radians(start), distances / 1000.0, np.radians(offsets / 8.0))
    samples = decoded(Answer.EXPRESS, first, encode_express(radians(following), np.zeros(32), np.zeros(32)))
    assert_array_equal(samples.ranges, distances / 1000.0)
    assert_array_equal(samples.qualities, np.where(distances > 0, 0x2F << 2, 0))
    expected = radians(encoder(start, following, 32) - offsets * 8)
    assert angle_distance(samples.angles_clockwise, expected).max() < ROUNDING
    assert ((samples.angles_clockwise >= 0.0) & (samples.angles_clockwise <= TURN)).all()


@given(q6, q6, whole(40, 65535), st.booleans())
def test_dense_round_trip(start, following, distances, restart):
    first = encode_dense(radians(start), distances / 1000.0, restart=restart)
    samples = decoded(Answer.DENSE, first, encode_dense(radians(following), np.zeros(40)))
    assert_array_equal(samples.ranges, distances / 1000.0)
    assert angle_distance(samples.angles_clockwise, radians(encoder(start, following, 40))).max() < ROUNDING
    assert packets(Answer.DENSE, first)["start"][0] >> 15 == restart


@given(q6, q6, whole(64, 65522), whole(64, 255), st.integers(0, 2**32 - 1), st.integers(0, 65535))
def test_ultra_dense_round_trip_to_within_the_steps_of_its_scales(start, following, distances, qualities, time, status):
    first = encode_ultra_dense(radians(start), distances / 1000.0, qualities, time=time, status=status)
    samples = decoded(Answer.ULTRA_DENSE, first, encode_ultra_dense(radians(following), np.zeros(64), np.zeros(64)))
    scale = np.searchsorted([2046, 8187, 24567], distances, side="right")
    lost = distances - np.rint(samples.ranges * 1000.0)
    assert ((lost >= 0) & (lost < scale + 2)).all()
    assert_array_equal(samples.qualities, qualities >> scale << scale)
    assert angle_distance(samples.angles_clockwise, radians(encoder(start, following, 64))).max() < ROUNDING
    packet = packets(Answer.ULTRA_DENSE, first)[0]
    assert (packet["time"], packet["status"]) == (time, status)


def ultra_distances(words, next_major):
    """Distances [mm] of a capsule, cabin by cabin as the protocol describes them."""

    def scale(code):
        for first, base, level in ((3328, 16384, 4), (1792, 4096, 3), (1280, 2048, 2), (512, 512, 1)):
            if code >= first:
                return base + (code - first) * 2**level, level
        return code, 0

    def difference(bits):
        return bits - 1024 if bits >= 512 else bits

    distances = []
    majors = [scale(word & 0xFFF) for word in words] + [scale(next_major)]
    for word, (m, level), (m2, level2) in zip(words, majors[:-1], majors[1:], strict=True):
        base1, level1 = (m2, level2) if m == 0 and m2 != 0 else (m, level)
        p1, p2 = difference(word >> 12 & 0x3FF), difference(word >> 22)
        distances += [
            m,
            0 if p1 in {-512, 511} else max(base1 + p1 * 2**level1, 0),
            0 if p2 in {-512, 511} else max(m2 + p2 * 2**level2, 0),
        ]
    return np.array(distances)


def ultra_packet(start, words):
    capsule = packets(Answer.ULTRA, encode_ultra(radians(start), np.zeros(96))).copy()
    capsule["cabin"][0] = words
    return capsule


@given(q6, q6, whole(32, 2**32 - 1), st.integers(0, 4095))
def test_ultra_decodes_any_words_as_the_protocol_says(start, following, words, next_major):
    both = np.concatenate([ultra_packet(start, words), ultra_packet(following, [next_major] * 32)])
    samples = FORMATS[Answer.ULTRA].decode(both)
    expected = ultra_distances(words.tolist(), next_major)
    assert_array_equal(samples.ranges, expected / 1000.0)
    offsets = [optical_offset_sdk(d) for d in expected]
    angles = radians(encoder(start, following, 96)) - offsets
    assert angle_distance(samples.angles_clockwise, angles).max() < ROUNDING


@given(whole(32, 2**32 - 1), st.integers(0, 4095))
def test_ultra_encodes_again_what_it_decoded(words, next_major):
    expected = ultra_distances(words.tolist(), next_major)
    next_range = ultra_distances([next_major] * 32, next_major)[0]
    fits = np.minimum(expected, 28656) / 1000.0
    data = encode_ultra(0.0, fits, next_range / 1000.0)
    again = decoded(Answer.ULTRA, data, encode_ultra(0.0, np.full(96, next_range / 1000.0)))
    assert_array_equal(again.ranges, np.where(expected <= 28656, fits, again.ranges))


@given(whole(97, 28656))
def test_ultra_keeps_ranges_to_within_the_step_of_the_scale_or_says_no_return(distances):
    """Only a difference of more than 510 steps is lost."""
    data = encode_ultra(0.0, distances[:96] / 1000.0, distances[96] / 1000.0)
    read = np.rint(1000.0 * decoded(Answer.ULTRA, data, encode_ultra(0.0, np.full(96, distances[96] / 1000.0))).ranges)
    lost = distances[:96] - read
    assert ((lost >= 0) & (lost < 16) | (read == 0)).all()
    assert ((read[::3] > 0) == (distances[:96:3] > 0)).all()


def optical_offset_sdk(distance_mm):
    """Optical offset [rad] in the integers of the SDK."""
    q2 = int(distance_mm) * 4
    if q2 < 200:
        return int(7.5 * 3.1415926535 * 65536 / 180.0) / 65536.0
    k = 98361 // q2
    return (int(8 * 3.1415926535 * 65536 / 180) - (k << 6) - (k * k * k) // 98304) / 65536.0


@given(whole(20, 40000))
def test_optical_offsets_follow_the_integers_of_the_sdk(distances):
    assert_array_equal(optical_offsets(distances / 1000.0), [optical_offset_sdk(d) for d in distances])


@pytest.mark.parametrize(
    "encode",
    [
        lambda ranges: encode_standard(np.zeros(1), ranges, np.zeros(1), np.zeros(1)),
        lambda ranges: encode_dense(0.0, np.full(40, ranges[0])),
        lambda ranges: encode_express(0.0, np.full(32, ranges[0]), np.zeros(32)),
        lambda ranges: encode_ultra(0.0, np.full(96, ranges[0])),
        lambda ranges: encode_ultra_dense(0.0, np.full(64, ranges[0]), np.zeros(64)),
    ],
)
@pytest.mark.parametrize("value", [-0.1, 70.0, np.inf, np.nan])
def test_a_range_that_does_not_fit_is_refused(encode, value):
    with pytest.raises(ValueError, match="ranges must lie between 0 and"):
        encode(np.array([value]))


def test_an_offset_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match=r"between 0 and 7\.875 deg"):
        encode_express(0.0, np.zeros(32), np.full(32, np.radians(8.0)))


@pytest.mark.parametrize("answer", FORMATS)
@given(data=st.data())
def test_a_damaged_packet_is_noticed(answer, data):
    """Any one bit, but in a standard node, which can only tell its check bits."""
    packet_format = FORMATS[answer]
    if answer is Answer.STANDARD:
        packet = bytearray(encode_standard(np.ones(1), np.ones(1), np.ones(1), np.zeros(1)))
        at, bit = data.draw(st.sampled_from([(0, 0), (0, 1), (1, 0)]))
    else:
        rng = np.random.default_rng(data.draw(st.integers(0, 9)))

        packet = bytearray(stream(answer, 1, rng).packets[0])
        at, bit = data.draw(st.integers(0, packet_format.size - 1)), data.draw(st.integers(0, 7))
    packet[at] ^= 1 << bit
    assert not packet_format.intact(np.frombuffer(packet, packet_format.dtype)).any()
