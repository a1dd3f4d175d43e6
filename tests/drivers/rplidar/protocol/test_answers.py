import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.errors import DriverError
from drivers.rplidar.codecs.formats import FORMATS
from drivers.rplidar.protocol.answers import (
    Answer,
    Conf,
    Descriptor,
    DeviceInfo,
    Health,
    SampleRate,
    pack_conf,
    unpack_name,
    unpack_number,
)

GOLDEN = {
    "a55a1400000004": Descriptor(20, False, Answer.INFO),
    "a55a0300000006": Descriptor(3, False, Answer.HEALTH),
    "a55a0400000015": Descriptor(4, False, Answer.SAMPLE_RATE),
    "a55a0800000020": Descriptor(8, False, Answer.LIDAR_CONF),
    "a55a0500004081": Descriptor(5, True, Answer.STANDARD),
    "a55a5400004082": Descriptor(84, True, Answer.EXPRESS),
    "a55a5400004085": Descriptor(84, True, Answer.DENSE),
    "a55a8400004084": Descriptor(132, True, Answer.ULTRA),
    "a55a0d03004083": Descriptor(781, True, Answer.HQ),
    "a55aaa00004086": Descriptor(170, True, Answer.ULTRA_DENSE),
}


@pytest.mark.parametrize(("packed", "descriptor"), GOLDEN.items(), ids=GOLDEN)
def test_golden_descriptors(packed, descriptor):
    assert descriptor.pack().hex() == packed
    assert Descriptor.unpack(bytes.fromhex(packed)) == descriptor


@given(st.integers(0, 2**30 - 1), st.booleans(), st.integers(0, 255))
def test_descriptors_keep_all_thirty_bits_of_their_size(size, multiple, kind):
    descriptor = Descriptor(size, multiple, kind)
    assert Descriptor.unpack(descriptor.pack()) == descriptor


@given(st.binary(max_size=9))
def test_what_is_no_descriptor_is_none(data):
    parsed = Descriptor.unpack(data)
    assert parsed is None or parsed.pack() == data


@pytest.mark.parametrize("answer", FORMATS)
def test_packet_sizes_are_those_of_the_golden_descriptors(answer):
    assert Descriptor(FORMATS[answer].size, True, answer) in GOLDEN.values()


@given(
    st.integers(0, 255),
    st.integers(0, 255),
    st.integers(0, 255),
    st.integers(0, 255),
    st.binary(min_size=16, max_size=16),
)
def test_device_info_round_trip(model, major, minor, hardware, serial):
    info = DeviceInfo(model, (major, minor), hardware, serial.hex().upper())
    payload = info.pack()
    assert payload[:4] == bytes([model, minor, major, hardware])
    assert DeviceInfo.unpack(payload) == info


def test_the_error_code_of_the_health_is_little_endian():
    assert Health.unpack(bytes([2, 0x34, 0x12])) == Health(2, 0x1234)
    assert Health(2, 0x1234).pack() == bytes([2, 0x34, 0x12])


@given(st.integers(0, 65535), st.integers(0, 65535))
def test_sample_rate_round_trip(standard, express):
    assert SampleRate.unpack(SampleRate(standard, express).pack()) == SampleRate(standard, express)


def test_values_of_the_configuration_are_fixed_point():
    assert pack_conf(Conf.US_PER_SAMPLE, 108.0) == bytes.fromhex("71000000006c0000")
    assert unpack_number(Conf.MAX_DISTANCE_M, bytes.fromhex("7400000000280000")) == 40.0


@given(st.sampled_from([kind for kind in Conf if kind is not Conf.MODE_NAME]), st.integers(0, 255))
def test_numbers_of_the_configuration_round_trip(kind, value):
    assert unpack_number(kind, pack_conf(kind, value)) == value


@given(st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=63))
def test_names_of_modes_round_trip(name):
    assert unpack_name(pack_conf(Conf.MODE_NAME, name)) == name


@pytest.mark.slow
@given(st.binary(max_size=8))
def test_an_answer_to_another_request_is_refused(payload):
    if payload[:4] != b"\x70\0\0\0":
        with pytest.raises(DriverError, match="MODE_COUNT was answered with"):
            unpack_number(Conf.MODE_COUNT, payload)


@pytest.mark.parametrize("kind", [DeviceInfo, Health, SampleRate])
def test_an_answer_of_another_length_is_refused(kind):
    with pytest.raises(DriverError, match="was answered with 1 bytes: expected"):
        kind.unpack(b"\0")
    with pytest.raises(DriverError, match="TYPICAL_MODE was answered with 1 bytes: expected 2"):
        unpack_number(Conf.TYPICAL_MODE, b"\x7c\0\0\0\1")
