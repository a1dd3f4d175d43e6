"""What the emulated devices say of themselves, and how they behave."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from types import MappingProxyType

from drivers.rplidar.protocol.answers import Answer, DeviceInfo, SampleRate


@dataclass(frozen=True, slots=True)
class Mode:
    """A scan mode.

    Parameters
    ----------
    name : as the device tells it.
    answer : packets in which the samples come.
    us_per_sample : time from sample to sample [us].
    max_distance : what is farther does not return [m].
    """

    name: str
    answer: Answer
    us_per_sample: float
    max_distance: float


class Motor(Enum):
    """How the rotation is controlled."""

    DTR = auto()
    """By a modem line, which a pseudo-terminal has not: it turns as long as there is power."""
    PWM = auto()
    """By SET_MOTOR_PWM through the accessory board; it stands until told."""
    RPM = auto()
    """By the scan, at the speed that MOTOR_SPEED sets."""


@dataclass(frozen=True, slots=True)
class Model:
    """An RPLIDAR.

    Parameters
    ----------
    name : of the model.
    info : answer to GET_INFO.
    baud : rate of the line.
    sample_rate : answer to GET_SAMPLERATE.
    modes : scan modes; their places are their ids, the first is that of SCAN.
    typical : id of the mode that the device recommends.
    motor : how the rotation is controlled.
    banner : what it prints when it has booted.
    boot_time : from a reset until it answers [s].
    """

    name: str
    info: DeviceInfo
    baud: int
    sample_rate: SampleRate
    modes: tuple[Mode, ...]
    typical: int
    motor: Motor
    banner: bytes = b""
    boot_time: float = 0.5


BANNER = b"RP LIDAR System.\r\nFirmware Ver 1.29 - 2b7, HW Ver 7\r\nModel: 18\r\n"
"""Boot banner of a device that has none of its own."""

BAUDS = (115200, 256000, 460800, 1000000)
"""Rates at which scanners of this kind talk."""

DEFAULT_RPM, LOWEST_RPM, HIGHEST_RPM = 600, 300, 900
DEFAULT_PWM = 660
"""Turns a motor at :data:`DEFAULT_RPM`."""


def _info(model: int, firmware: tuple[int, int], hardware: int) -> DeviceInfo:
    return DeviceInfo(model, firmware, hardware, f"{model:02X}C1E59AF0C5E29DD2B6E39DF5D3493116"[:32])


def _a_series(firmware: str, hardware: int, model: int) -> bytes:
    return f"RP LIDAR System.\r\nFirmware Ver {firmware} - rel, HW Ver {hardware}\r\nModel: {model:02X}\r\n".encode()


MODELS: Mapping[str, Model] = MappingProxyType(
    {
        # Read-outs of an A1M8 and of an S1.
        "A1": Model(
            name="A1",
            info=_info(0x18, (1, 29), 7),
            baud=115200,
            sample_rate=SampleRate(508, 254),
            modes=(
                Mode("Standard", Answer.STANDARD, 508.0, 12.0),
                Mode("Express", Answer.EXPRESS, 254.0, 12.0),
                Mode("Boost", Answer.ULTRA, 127.0, 12.0),
                Mode("Sensitivity", Answer.ULTRA, 127.0, 12.0),
                Mode("Stability", Answer.ULTRA, 201.0, 12.0),
            ),
            typical=3,
            motor=Motor.DTR,
            banner=_a_series("1.29", 7, 0x18),
        ),
        # An A2M8 whose modes are in an issue of the ROS driver, with 2.0, 4.0 and 8.0 thousand samples a second.
        "A2": Model(
            name="A2",
            info=_info(0x28, (1, 24), 5),
            baud=115200,
            sample_rate=SampleRate(508, 254),
            modes=(
                Mode("Standard", Answer.STANDARD, 508.0, 12.0),
                Mode("Express", Answer.EXPRESS, 254.0, 12.0),
                Mode("Boost", Answer.ULTRA, 127.0, 12.0),
            ),
            typical=2,
            motor=Motor.PWM,
            banner=_a_series("1.24", 5, 0x28),
        ),
        # The same of an A3M1: 4.0, 7.9, 15.9, 15.9 and 10.0 thousand.
        "A3": Model(
            name="A3",
            info=_info(0x31, (1, 26), 6),
            baud=256000,
            sample_rate=SampleRate(252, 126),
            modes=(
                Mode("Standard", Answer.STANDARD, 252.0, 25.0),
                Mode("Express", Answer.EXPRESS, 126.0, 25.0),
                Mode("Boost", Answer.ULTRA, 63.0, 25.0),
                Mode("Sensitivity", Answer.ULTRA, 63.0, 25.0),
                Mode("Stability", Answer.ULTRA, 100.0, 25.0),
            ),
            typical=3,
            motor=Motor.PWM,
            banner=_a_series("1.26", 6, 0x31),
        ),
        "S1": Model(
            name="S1",
            info=_info(0x61, (1, 28), 18),
            baud=256000,
            sample_rate=SampleRate(244, 108),
            modes=(
                Mode("Standard", Answer.STANDARD, 244.0, 40.0),
                Mode("DenseBoost", Answer.DENSE, 108.0, 40.0),
            ),
            typical=1,
            motor=Motor.RPM,
            boot_time=2.0,
        ),
        # 32,000 samples a second up to 30 m are its data sheet's; the time of the standard mode is assumed.
        "S2": Model(
            name="S2",
            info=_info(0x71, (1, 1), 18),
            baud=1000000,
            sample_rate=SampleRate(62, 31),
            modes=(
                Mode("Standard", Answer.STANDARD, 62.5, 16.0),
                Mode("DenseBoost", Answer.ULTRA_DENSE, 31.25, 30.0),
            ),
            typical=1,
            motor=Motor.RPM,
            boot_time=2.0,
        ),
    }
)
"""The emulated models by the name that the command line takes."""
