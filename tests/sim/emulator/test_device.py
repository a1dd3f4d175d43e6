"""The states of an emulated scanner, and its answers, as the protocol page has them."""

import math
import struct

import pytest
from emulator_line import QUIET, make

from drivers.rplidar import FORMATS, Answer, Command, Conf, DeviceInfo, Health, Request, unpack_name, unpack_number
from drivers.rplidar.protocol.requests import express_scan, lidar_conf, motor_pwm, motor_speed, request
from sim.emulator import FAULTS, MODELS, Device


def ask(device: Device, data: bytes, time: float = 0.0) -> bytes:
    device.write(data, time)
    return device.read(time + 0.1)


def test_an_s1_says_who_it_is() -> None:
    answer = ask(make(), request(Command.GET_INFO))
    assert answer[:7] == bytes.fromhex("a55a1400000004")
    info = DeviceInfo.unpack(answer[7:])
    assert (info.model, info.firmware, info.hardware) == (0x61, (1, 28), 18)
    assert ask(make(), request(Command.GET_HEALTH)) == bytes.fromhex("a55a0300000006 000000")
    assert ask(make(), request(Command.GET_SAMPLERATE)) == bytes.fromhex("a55a0400000015 f4006c00")
    assert ask(make(), request(Command.GET_ACC_BOARD_FLAG)) == bytes.fromhex("a55a04000000ff 00000000")
    assert ask(make("A2"), request(Command.GET_ACC_BOARD_FLAG)) == bytes.fromhex("a55a04000000ff 01000000")


@pytest.mark.parametrize("name", MODELS)
def test_the_modes_are_enumerated(name: str) -> None:
    model = MODELS[name]

    def conf(kind: Conf, mode: int | None = None) -> bytes:
        answer = ask(make(name), lidar_conf(kind, mode))
        assert answer[:2] + answer[6:7] == bytes.fromhex("a55a20")
        assert len(answer) == 7 + answer[2]
        return answer[7:]

    assert unpack_number(Conf.MODE_COUNT, conf(Conf.MODE_COUNT)) == len(model.modes)
    assert unpack_number(Conf.TYPICAL_MODE, conf(Conf.TYPICAL_MODE)) == model.typical
    for mode_id, mode in enumerate(model.modes):
        assert unpack_name(conf(Conf.MODE_NAME, mode_id)) == mode.name
        assert unpack_number(Conf.ANSWER_TYPE, conf(Conf.ANSWER_TYPE, mode_id)) == mode.answer
        assert unpack_number(Conf.MAX_DISTANCE_M, conf(Conf.MAX_DISTANCE_M, mode_id)) == mode.max_distance
        assert unpack_number(Conf.US_PER_SAMPLE, conf(Conf.US_PER_SAMPLE, mode_id)) == mode.us_per_sample
    assert conf(Conf.MODE_NAME, len(model.modes)) == struct.pack("<I", Conf.MODE_NAME)


def test_limits_of_the_rotation_are_told() -> None:
    values = {0x01: "58029402", 0x04: "2c01", 0x05: "8403"}
    for kind, value in values.items():
        payload = struct.pack("<I", kind)
        assert ask(make(), Request(Command.GET_LIDAR_CONF, payload).pack())[7:] == payload + bytes.fromhex(value)


def test_a_request_is_heard_in_pieces_and_forgotten_after_five_seconds() -> None:
    device = make()
    device.write(b"\xa5", 0.0)
    assert ask(device, b"\x52", 4.9)[6] == Answer.HEALTH
    device.write(b"\xa5", 10.0)
    assert ask(device, b"\x52", 15.1) == b""
    assert ask(device, b"\xa5\x52", 15.2)[6] == Answer.HEALTH


def test_a_request_with_a_wrong_checksum_is_not_heard() -> None:
    good = express_scan(1)
    assert ask(make(), good[:-1] + b"\0") == b""
    assert ask(make(), good) != b""


def test_a_request_during_an_answer_is_discarded() -> None:
    assert len(ask(make(), request(Command.GET_INFO) + request(Command.GET_HEALTH))) == 27


def test_the_descriptor_comes_at_once_and_the_samples_when_the_rotation_is_stable() -> None:
    for command, spin_up in ((Command.SCAN, 0.3), (Command.FORCE_SCAN, 0.0)):
        device = make()
        device.write(request(command), 0.0)
        (first, descriptor), (second, _) = (next(device.chunks(10.0)) for _ in range(2))
        assert (descriptor[6], first < 0.01) == (Answer.STANDARD, True)
        assert (second - first > 0.3) == (spin_up > 0.0)


@pytest.mark.parametrize("ending", [Command.STOP, Command.GET_HEALTH, Command.RESET])
def test_any_request_ends_a_scan(ending: Command) -> None:
    device = make()
    device.write(express_scan(1), 0.0)
    assert len(device.read(5.0)) > 10000
    device.write(request(ending), 5.0)
    assert len(device.read(10.0)) == (10 if ending is Command.GET_HEALTH else 0)
    assert math.isinf(device.next_time)
    device.write(express_scan(1), 10.0)
    assert len(device.read(15.0)) > 10000


def test_motor_speed_changes_a_scan_that_goes_on_and_zero_ends_it() -> None:
    device = make()
    device.write(express_scan(1), 0.0)
    device.read(5.0)
    device.write(motor_speed(900), 5.0)
    device.read(8.0)
    starts = [int.from_bytes(data[2:4], "little") / 64.0 for _, data in device.chunks(8.1)]
    assert (starts[1] - starts[0]) % 360.0 == pytest.approx(900 * 6 * 4320e-6, rel=0.02)
    device.write(motor_speed(0), 8.1)
    assert device.read(20.0) == b""


def test_an_a2_waits_for_its_motor() -> None:
    device = make("A2")
    device.write(express_scan(2), 0.0)
    assert len(device.read(10.0)) == 7
    device.write(motor_pwm(660), 10.0)
    assert len(device.read(15.0)) > 10000


def test_modes_that_are_not_there_and_requests_without_payload_are_ignored() -> None:
    for data in (
        express_scan(2),
        Request(Command.EXPRESS_SCAN, b"\1").pack(),
        Request(Command.MOTOR_SPEED, b"").pack(),
    ):
        assert ask(make(), data) == b""


@pytest.mark.parametrize(("name", "silence"), [("S1", 2.0), ("A1", 0.5)])
def test_a_reset_takes_its_time_and_an_a1_says_so(name: str, silence: float) -> None:
    device = make(name)
    device.write(request(Command.RESET), 0.0)
    assert ask(device, request(Command.GET_HEALTH), silence - 0.1)[:2] == b""
    assert device.read(silence + 0.1)[:3] == (b"" if name == "S1" else b"RP ")
    assert ask(device, request(Command.GET_HEALTH), silence + 0.2)[6] == Answer.HEALTH


def test_banner_and_silence_can_be_had_of_any_model() -> None:
    device = make("S1", faults=("banner",))
    device.write(request(Command.RESET), 0.0)
    assert device.read(3.0).startswith(b"RP LIDAR System")
    device = make("A1", faults=("silent-reset",))
    device.write(request(Command.RESET), 0.0)
    assert device.read(1.9) == b""


@pytest.mark.slow
def test_protection_stop_answers_scans_not_and_is_left_by_a_reset() -> None:
    device = make(faults=("protection-stop",))
    assert Health.unpack(ask(device, request(Command.GET_HEALTH))[7:]).status == 2
    assert ask(device, request(Command.GET_INFO), 0.2)[6] == Answer.INFO
    assert ask(device, request(Command.SCAN), 0.4) == b""
    device.write(request(Command.RESET), 0.6)
    assert Health.unpack(ask(device, request(Command.GET_HEALTH), 3.0)[7:]).status == 0
    device.write(request(Command.SCAN), 4.0)
    device.read(70.0)
    assert math.isinf(device.next_time), "it falls into it again"
    assert Health.unpack(ask(device, request(Command.GET_HEALTH), 70.0)[7:]).status == 2


@pytest.mark.parametrize("name", MODELS)
def test_only_its_own_baud_rate_is_understood(name: str) -> None:
    for faults in ((), ("wrong-baud",)):
        device = make(name, faults=faults)
        assert (device.baud == MODELS[name].baud) == (not faults)
        for baud in (115200, 256000, 460800, 1000000):
            device.write(request(Command.GET_INFO), 0.0, baud)
            answer = device.read(0.1, baud)
            assert (answer[:2] == b"\xa5\x5a") == (baud == device.baud)
    device = make(name)
    device.write(request(Command.GET_INFO), 0.0)
    garbled = device.read(0.1, MODELS[name].baud + 1)
    assert (len(garbled), garbled[:2] == b"\xa5\x5a") == (27, False)


def test_stale_samples_come_before_the_first_answer() -> None:
    device = make(faults=("stale-samples",))
    before = device.read(5.0)
    assert len(before) > 10000, "the scan of a program before"
    device.write(request(Command.GET_HEALTH), 5.0)
    answer = device.read(6.0)
    assert answer[-10:] == bytes.fromhex("a55a0300000006000000")
    assert len(answer) > 10
    assert device.ledger.packets == 0, "nobody asked for them"


@pytest.mark.slow
def test_unplugged_it_neither_hears_nor_speaks_and_comes_back_at_rest() -> None:
    device = make(faults=("unplug",))
    device.write(express_scan(1), 0.0)
    device.read(100.0)
    assert device.away_until is not None
    assert 15.0 < device.away_until < 100.0
    device.write(request(Command.GET_INFO), device.away_until)
    assert device.read(200.0) == b""
    time = device.away_until
    device.plug_in()
    assert device.away_until is None
    assert device.read(time + 5.0) == b""
    assert ask(device, request(Command.GET_INFO), time + 5.0)[6] == Answer.INFO


def test_a_fault_that_is_none_is_named() -> None:
    with pytest.raises(ValueError, match=r"unknown fault 'gremlins': known are flipped-bytes, .*stall"):
        Device(MODELS["S1"], QUIET, faults=["gremlins"])
    assert len(FAULTS) == 13


@pytest.mark.parametrize("name", MODELS)
def test_no_mode_is_too_fast_for_its_line(name: str) -> None:
    model = MODELS[name]
    for mode in model.modes:
        packets = FORMATS[mode.answer]
        assert packets.size * 10 / model.baud < packets.samples * mode.us_per_sample * 1e-6
