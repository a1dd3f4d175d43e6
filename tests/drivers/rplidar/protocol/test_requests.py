import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.rplidar.protocol import requests
from drivers.rplidar.protocol.answers import Conf
from drivers.rplidar.protocol.requests import Command, Request, RequestReader

GOLDEN = {
    "a525": requests.request(Command.STOP),
    "a540": requests.request(Command.RESET),
    "a520": requests.request(Command.SCAN),
    "a550": requests.request(Command.GET_INFO),
    "a552": requests.request(Command.GET_HEALTH),
    "a559": requests.request(Command.GET_SAMPLERATE),
    "a5f0029402c1": requests.motor_pwm(660),
    "a5a802580255": requests.motor_speed(600),
    "a5ff04000000005e": requests.request(Command.GET_ACC_BOARD_FLAG),
    "a58205000000000022": requests.express_scan(0),
    "a58205010000000023": requests.express_scan(1),
    "a584047000000055": requests.lidar_conf(Conf.MODE_COUNT),
    "a584047c00000059": requests.lidar_conf(Conf.TYPICAL_MODE),
    "a584067f000000010059": requests.lidar_conf(Conf.MODE_NAME, 1),
    "a5840671000000010057": requests.lidar_conf(Conf.US_PER_SAMPLE, 1),
    "a5840674000000010052": requests.lidar_conf(Conf.MAX_DISTANCE_M, 1),
    "a5840675000000010053": requests.lidar_conf(Conf.ANSWER_TYPE, 1),
}


@pytest.mark.parametrize(("expected", "built"), GOLDEN.items(), ids=GOLDEN)
def test_golden_bytes(expected, built):
    assert built.hex() == expected


@st.composite
def any_request(draw):
    command = draw(st.sampled_from(Command))
    return Request(command, draw(st.binary(max_size=255)) if command.has_payload else b"")


@given(st.lists(any_request(), max_size=4), st.data())
def test_requests_are_read_back_however_the_bytes_are_cut(sent, data):
    stream = b"".join(request.pack() for request in sent)
    reader, received, at = RequestReader(), [], 0
    while at < len(stream):
        size = data.draw(st.integers(1, len(stream) - at))
        received += reader.feed(stream[at : at + size])
        at += size
    assert received == sent


@given(st.binary().filter(lambda noise: b"\xa5" not in noise), any_request())
def test_what_is_no_request_is_skipped(noise, request_):
    assert RequestReader().feed(noise + request_.pack()) == [request_]


def test_a_request_with_a_wrong_checksum_is_none():
    damaged = bytearray(requests.motor_speed(600))
    damaged[3] ^= 1
    assert RequestReader().feed(bytes(damaged) + requests.request(Command.STOP)) == [Request(Command.STOP)]


@given(st.binary())
def test_any_bytes_may_come(noise):
    assert all(request.command in Command for request in RequestReader().feed(noise))


def test_a_payload_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="at most 255"):
        Request(Command.SET_LIDAR_CONF, bytes(256)).pack()
    with pytest.raises(ValueError, match="STOP takes no payload"):
        Request(Command.STOP, b"1").pack()
